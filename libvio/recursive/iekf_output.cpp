// What is published: states, landmarks, motions between key-frames.
#include <algorithm>

#include "libvio/batch/rig_refinement.h"
#include "libvio/geometry/relative_pose.h"
#include "libvio/geometry/so3.h"
#include "libvio/recursive/body_frame.h"
#include "libvio/recursive/iekf_impl.h"

namespace vio {

using Eigen::Vector3d;

// The core at a time on the camera's clock, which the state's is but for what the time offset's
// estimate has changed; P: its covariance, with the offset's.
CoreState Iekf::Impl::core_at(TimeNs t, Matrix15d& P) const {
    CoreState core = state->core();
    const int c = std::min(15, state->core_size());
    if (state->mount_size() == 0) {
        P.topLeftCorner(c, c) = state->core_covariance().topLeftCorner(c, c);
        return core;
    }
    const Vector9d rate = rate_of(core, now);
    Eigen::Matrix<double, 15, 16> by_offset = Eigen::Matrix<double, 15, 16>::Identity();
    by_offset.block<9, 1>(0, 15) = rate;
    P = by_offset * state->timed_covariance() * by_offset.transpose();
    const Vector9d moved = rate * to_seconds(t + from_seconds(rig.time_offset) - now.t);
    core.T_W_I = core.T_W_I.boxplus(moved.head<6>());
    core.v_W += moved.tail<3>();
    return core;
}

// Adds what the uncertain place of the IMU on the body makes of the body's state.
void Iekf::Impl::add_mounting(StateEstimate& body, const Vector3d& omega_I) const {
    const double rotation = options.imu_rotation_sigma, position = options.imu_position_sigma;
    if (rotation == 0 && position == 0) return;
    const Eigen::Matrix3d R_W_I = body.T_W_B.R * rig.T_B_I.R;
    const Eigen::Matrix3d lever = so3::skew(rig.T_B_I.inverse().p);
    Eigen::Matrix<double, 9, 6> J = Eigen::Matrix<double, 9, 6>::Zero();
    J.block<3, 3>(kRotation, 0) = -rig.T_B_I.R;
    J.block<3, 3>(kPosition, 0) = R_W_I * lever;
    J.block<3, 3>(kPosition, 3) = -body.T_W_B.R;
    J.block<3, 6>(kVelocity, 0) =
        R_W_I * so3::skew(omega_I) * R_W_I.transpose() * J.block<3, 6>(kPosition, 0);
    Vector6d variance;
    variance << Vector3d::Constant(rotation * rotation), Vector3d::Constant(position * position);
    body.covariance.topLeftCorner<9, 9>() += J * variance.asDiagonal() * J.transpose();
}

// State of the body at t.
StateEstimate Iekf::Impl::body_at(TimeNs t, int features) const {
    const Vector3d omega_I = !use_imu ? Vector3d(Vector3d::Zero())
                             : state->core_size() == static_cast<int>(CoreKind::smooth)
                                 ? state->core().omega_I
                                 : Vector3d(now.gyro - state->core().gyro_bias);
    Matrix15d J, P = Matrix15d::Zero();
    const CoreState core = core_at(t, P);
    StateEstimate out = body_state(core, rig.T_B_I.inverse(), omega_I, &J);
    out.t = t;
    P = (J * P * J.transpose()).eval();
    out.covariance = 0.5 * (P + P.transpose());
    add_mounting(out, omega_I);
    out.lost = lost || image_missing(t);
    out.features = features;
    return out;
}

// Adds the state to the result, once for each time.
void Iekf::Impl::report(TimeNs t, int features) {
    if (t <= last_report) return;
    last_report = t;
    result.states.push_back(body_at(t, features));
    if (state->core_size() > kGravity) {
        result.g_W = state->core().g_W;
        result.gravity_covariance = state->core_covariance().block<3, 3>(kGravity, kGravity);
    }
}

// For a new start that begins at this image to join on to.
void Iekf::Impl::note_coasting(TimeNs t) {
    coasted.insert({t, body_at(t, used)});
    while (static_cast<int>(coasted.size()) > 4 * options.prefix_images)
        coasted.erase(coasted.begin());
}

std::optional<RefinedRig> Iekf::refined_rig() const {
    const Impl& f = *impl_;
    if (!f.state || f.state->mount_size() == 0) return std::nullopt;
    RefinedRig refined{f.rig, {}, f.known_mount().covariance};
    Eigen::Matrix<double, kMountSize, 1> change, stated;
    change << f.rig.T_I_C().boxminus(f.stated_T_I_C),
        f.rig.time_offset - to_seconds(f.stated_offset);
    stated << Vector3d::Constant(f.options.camera_rotation_sigma),
        Vector3d::Constant(f.options.camera_position_sigma), f.options.time_offset_sigma;
    for (int k = 0; k < kMountSize; ++k) {
        const auto& [name, unit] = batch::kMountUnknowns[k];
        refined.unknowns.push_back(
            {name, unit, change(k), std::sqrt(refined.covariance(k, k)), stated(k)});
    }
    return refined;
}

// A new key-frame where the image shows too little of the last one, and before the last one's clone
// is released: the motion between them then follows from the joint covariance of their clones.
void Iekf::Impl::follow_keyframes(const FeatureFrame& frame) {
    if (!keyframes.wants(frame) && image_idx - keyframe_idx < options.clones - 1) return;
    keyframes.take(frame);
    end_keyframe();
}

void Iekf::Impl::end_keyframe() {
    const int a = state->find_clone(keyframe_idx), b = state->find_clone(image_idx);
    if (a >= 0 && b >= 0 && a != b) {
        const Pose T_I_B = rig.T_B_I.inverse();
        const Pose &A = state->clones()[a].T_W_I, &B = state->clones()[b].T_W_I;
        const RelativePose relative = relative_pose(A * T_I_B, B * T_I_B);
        Eigen::Matrix<double, 6, 12> J = relative.J;
        J.leftCols<6>() = (J.leftCols<6>() * right_compose_jacobian(A, T_I_B)).eval();
        J.rightCols<6>() = (J.rightCols<6>() * right_compose_jacobian(B, T_I_B)).eval();
        const auto P_all = state->covariance();
        const int at[2] = {state->clone_offset(a), state->clone_offset(b)};
        Eigen::Matrix<double, 12, 12> P;
        for (int r = 0; r < 2; ++r)
            for (int c = 0; c < 2; ++c)
                P.block<6, 6>(6 * r, 6 * c) = P_all.block<6, 6>(at[r], at[c]);
        result.keyframe_motions.push_back(
            {keyframe_time, image_time, relative.T_A_B, J * P * J.transpose()});
    }
    keyframe_idx = image_idx;
    keyframe_time = image_time;
}

// Notes a landmark's estimate for the result.
void Iekf::Impl::note_landmark(int i) {
    const LandmarkState& landmark = state->landmarks()[i];
    if (!landmark.point.in_front()) return;
    const PlacedPoint place =
        placed(landmark.point, state->clones()[landmark.anchor].T_W_I, state->mount().T_I_C);
    Eigen::Matrix<double, 3, 9> G;
    G << place.J_rotation, Eigen::Matrix3d::Identity(), place.J_point;
    const int anchor = state->clone_offset(landmark.anchor), at = state->landmark_offset(i);
    const auto P_all = state->covariance();
    Eigen::Matrix<double, 9, 9> P;
    P << P_all.block<6, 6>(anchor, anchor), P_all.block<6, 3>(anchor, at),
        P_all.block<3, 6>(at, anchor), P_all.block<3, 3>(at, at);
    landmark_estimates[landmark.id] = {landmark.id, place.p_W, G * P * G.transpose(),
                                       landmark.observations};
}

// Takes landmarks out of the state.
void Iekf::Impl::give_up(const std::vector<bool>& remove) {
    for (std::size_t i = 0; i < remove.size(); ++i)
        if (remove[i]) note_landmark(static_cast<int>(i));
    state->marginalise(remove);
}

}  // namespace vio
