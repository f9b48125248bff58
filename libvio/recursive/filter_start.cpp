#include "libvio/recursive/filter_start.h"

#include <algorithm>
#include <numeric>

#include "libvio/recursive/body_frame.h"

namespace vio {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;

namespace {

// Errors of core and points in W to those of core, first clone and points anchored to it.
MatrixXd anchored_covariance(const MatrixXd& joint, int core_size, const Pose& T_W_I,
                             const Pose& T_I_C, const std::vector<LandmarkState>& landmarks) {
    const Eigen::Index n = joint.rows();
    MatrixXd A = MatrixXd::Zero(n + 6, n);
    A.topLeftCorner(core_size, core_size).setIdentity();
    A.block<6, 6>(core_size, 0).setIdentity();
    for (Eigen::Index i = 0; i < static_cast<Eigen::Index>(landmarks.size()); ++i) {
        const PlacedPoint place =
            placed(landmarks[static_cast<std::size_t>(i)].point, T_W_I, T_I_C);
        const Matrix3d inverse = place.J_point.inverse();
        A.block<3, 3>(core_size + 6 + 3 * i, core_size + 3 * i) = inverse;
        A.block<3, 3>(core_size + 6 + 3 * i, kRotation) = -inverse * place.J_rotation;
        A.block<3, 3>(core_size + 6 + 3 * i, kPosition) = -inverse;
    }
    const MatrixXd result = A * joint * A.transpose();
    return 0.5 * (result + result.transpose());
}

// All but the most precise landmarks, as many as there is room for.
std::vector<bool> surplus(const FilterState& state, const FilterStartOptions& options) {
    const int n = static_cast<int>(state.landmarks().size());
    std::vector<double> sigma;
    for (int i = 0; i < n; ++i) {
        const int at = state.landmark_offset(i) + 2;
        sigma.push_back(std::sqrt(state.covariance()(at, at)) / state.landmarks()[i].point.x.z());
    }
    std::vector<int> order(n);
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return sigma[a] < sigma[b]; });
    std::vector<bool> remove(n, true);
    for (int rank = 0; rank < std::min(n, options.max_landmarks); ++rank)
        if (sigma[order[rank]] < options.point_sigma) remove[order[rank]] = false;
    return remove;
}

}  // namespace

FilterState started(const BatchTail& tail, const Rig& rig, const MotionModel& motion,
                    const ImuReading& at, const Vector3d& omega_I,
                    const FilterStartOptions& options) {
    CoreState core = imu_state(tail.state, rig.T_B_I, omega_I);
    core.g_W = tail.g_W;

    // Covariance of the body's errors to that of the IMU's, then to that of the model's core.
    Matrix15d J;
    body_state(core, rig.T_B_I.inverse(), omega_I, &J);
    const Matrix15d J_inverse = J.inverse();
    const Eigen::Index points = tail.covariance.rows() - 15;
    MatrixXd joint = tail.covariance;
    joint.topRows<15>() = (J_inverse * joint.topRows<15>()).eval();
    joint.leftCols<15>() = (joint.leftCols<15>() * J_inverse.transpose()).eval();
    CoreMatrix lift;
    FilterState state =
        motion.start(core, joint.topLeftCorner<15, 15>(), at, options.invariant, &lift);
    const int c = state.core_size();
    MatrixXd lifted(c + points, c + points);
    lifted.topLeftCorner(c, c) = state.core_covariance();
    lifted.topRightCorner(c, points) = lift * joint.topRightCorner(15, points);
    lifted.bottomLeftCorner(points, c) = lifted.topRightCorner(c, points).transpose();
    lifted.bottomRightCorner(points, points) = joint.bottomRightCorner(points, points);

    state.clone(0);
    const Pose T_I_C = rig.T_I_C();
    std::vector<LandmarkState> landmarks;
    for (const LandmarkEstimate& from : tail.landmarks) {
        LandmarkState landmark;
        landmark.id = from.id;
        landmark.anchor = 0;
        landmark.point = anchored(from.p_W, core.T_W_I, T_I_C);
        landmark.observations = from.observations;
        landmarks.push_back(landmark);
    }
    state.start_landmarks(landmarks, anchored_covariance(lifted, c, core.T_W_I, T_I_C, landmarks));
    state.marginalise(surplus(state, options));
    return state;
}

}  // namespace vio
