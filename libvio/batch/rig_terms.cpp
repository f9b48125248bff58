// The rig as unknown: how residuals change with the camera's place on the IMU, the offset of its
// clock and its intrinsics.
#include "libvio/batch/objective.h"
#include "libvio/camera/intrinsics.h"
#include "libvio/geometry/so3.h"

namespace vio::batch {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;

void Objective::add_rig_image(const State& state, const RigUnknowns& unknowns,
                              const NormalEquations& eq, Border& border) const {
    const int first_intrinsic = unknowns.count() - unknowns.intrinsics;
    std::optional<IntrinsicJacobian> d_intrinsics;
    if (unknowns.intrinsics > 0) d_intrinsics.emplace(*model_.camera, unknowns.intrinsics);
    Eigen::Matrix2Xd J = Eigen::Matrix2Xd::Zero(2, unknowns.count());
    for (const Observation& observation : model_.observations) {
        if (!observation.active) continue;
        const InertialState& I = state.frames[observation.frame_idx].motion;
        const Vector3d p_I = I.R.transpose() * (state.points[observation.point_idx] - I.p),
                       p_C = model_.T_C_I * p_I;
        Matrix23d J_C;
        const auto uv = model_.camera->project(p_C, &J_C);
        if (!uv) continue;  // drawn back by the angle to its sight line, which the rig hardly moves
        const Eigen::Vector2d r = observation.sqrt_information * (*uv - observation.uv_px);
        if (r.squaredNorm() > largest_distance2_) continue;
        J_C = observation.sqrt_information * J_C;
        if (unknowns.extrinsics) J.leftCols<6>() << J_C * so3::skew(p_C), -J_C * model_.T_C_I.R;
        if (d_intrinsics)
            J.middleCols(first_intrinsic, unknowns.intrinsics) =
                observation.sqrt_information * (*d_intrinsics)(p_C);
        const Eigen::Matrix2Xd weighted = image_weight(r.squaredNorm()) * J;
        border.H.noalias() += weighted.transpose() * J;
        border.gradient.noalias() += weighted.transpose() * r;
        const Matrix23d J_X = J_C * model_.T_C_I.R * I.R.transpose();
        border.points.middleRows<3>(3 * static_cast<Index>(observation.point_idx)).noalias() +=
            J_X.transpose() * weighted;
        if (observation.frame_idx == 0 && !model_.surveyed()) continue;  // held
        Eigen::Matrix<double, 2, 6> J_pose;
        J_pose << J_C * model_.T_C_I.R * so3::skew(p_I), -J_X;
        border.reduced.middleRows<6>(eq.layout().index(observation.frame_idx, 0)).noalias() +=
            J_pose.transpose() * weighted;
    }
}

// Readings that are taken later by d say the same of states as the readings that are there do of
// states d earlier: (R, p, v) - d (w, v, a).
void Objective::add_time_offset(const State& state, int column, const NormalEquations& eq,
                                Border& border) const {
    const Eigen::Matrix3d J_gravity = gravity_jacobian(state.gravity);
    const Layout& layout = eq.layout();
    const auto rate = [&](int i) {
        const State::Frame& frame = state.frames[i];
        Vector9d xi;
        xi << model_.gyro_at_image[i] - frame.bias.gyro, frame.motion.v,
            frame.motion.R * (model_.accel_at_image[i] - frame.bias.accel) + state.gravity;
        return xi;
    };
    for (int i = 0; i < static_cast<int>(intervals_.size()); ++i) {
        const State::Frame &a = state.frames[i], &b = state.frames[i + 1];
        const Matrix9d& L = intervals_[i].sqrt_information;
        PreintegratedImu::Jacobian D;
        const Vector9d r =
            L * intervals_[i].readings.residual(a.motion, b.motion, a.bias, state.gravity, &D);
        const Vector9d J = -L * (D.state_i * rate(i) + D.state_j * rate(i + 1));
        border.H(column, column) += J.squaredNorm();
        border.gradient(column) += J.dot(r);
        const auto add = [&](int frame, int component, const Eigen::Ref<const MatrixXd>& other) {
            const int row = layout.index(frame, component);
            border.reduced.col(column).segment(row, other.cols()) += other.transpose() * J;
        };
        if (i > 0 || model_.surveyed()) add(i, kRotation, L * D.state_i.leftCols<6>());
        add(i, kVelocity, L * D.state_i.rightCols<3>());
        add(i, kGyroBias, L * D.bias);
        add(i + 1, kRotation, L * D.state_j.leftCols<6>());
        add(i + 1, kVelocity, L * D.state_j.rightCols<3>());
        border.reduced.col(column).segment<3>(layout.gravity_index()) +=
            (L * D.gravity * J_gravity).transpose() * J;
    }
}

Border Objective::linearize_rig(const State& state, const RigUnknowns& unknowns,
                                const NormalEquations& eq) const {
    const int n = unknowns.count();
    Border border{MatrixXd::Zero(eq.gradient.size(), n),
                  MatrixXd::Zero(3 * static_cast<Index>(model_.points.size()), n),
                  MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n)};
    if (unknowns.extrinsics || unknowns.intrinsics > 0) add_rig_image(state, unknowns, eq, border);
    if (unknowns.time_offset && model_.inertial)
        add_time_offset(state, unknowns.extrinsics ? 6 : 0, eq, border);
    return border;
}

}  // namespace vio::batch
