#include "libvio/recursive/filter_start.h"

#include <algorithm>
#include <numeric>

#include "libvio/base/blas.h"
#include "libvio/recursive/body_frame.h"

namespace vio {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;

namespace {

// Errors of core, points in W and mount, of `mounted` components, to those of core, mount, first
// clone and points anchored to it. rate: see started().
MatrixXd anchored_covariance(const MatrixXd& joint, int core_size, int mounted,
                             const Vector9d& rate, const Pose& T_W_I, const Pose& T_I_C,
                             const std::vector<LandmarkState>& landmarks) {
    const Eigen::Index n = joint.rows(), mount = n - mounted, clone = core_size + mounted;
    MatrixXd A = MatrixXd::Zero(n + 6, n);
    A.topLeftCorner(core_size, core_size).setIdentity();
    A.block(core_size, mount, mounted, mounted).setIdentity();
    if (mounted > 0) A.block<9, 1>(0, mount + kTimeOffset) = -rate;
    A.block<6, 6>(clone, 0).setIdentity();
    for (Eigen::Index i = 0; i < static_cast<Eigen::Index>(landmarks.size()); ++i) {
        const PlacedPoint place =
            placed(landmarks[static_cast<std::size_t>(i)].point, T_W_I, T_I_C);
        const Matrix3d inverse = place.J_point.inverse();
        auto rows = A.middleRows<3>(clone + 6 + 3 * i);
        rows.middleCols<3>(core_size + 3 * i) = inverse;
        rows.middleCols<3>(kRotation) = -inverse * place.J_rotation;
        rows.middleCols<3>(kPosition) = -inverse;
        if (mounted > 0) rows.middleCols<6>(mount) = -inverse * place.J_camera;
    }
    const blas::Serial serial;
    MatrixXd A_joint = MatrixXd::Zero(n + 6, n), result = MatrixXd::Zero(n + 6, n + 6);
    blas::add_product(1, A, joint, A_joint);
    blas::add_product(1, A_joint, A, result);
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

FilterState started(const BatchTail& tail, const MountEstimate& mount, const Rig& rig,
                    const MotionModel& motion, const ImuReading& at, const Vector3d& omega_I,
                    const FilterStartOptions& options) {
    CoreState core = imu_state(tail.state, rig.T_B_I, omega_I);
    core.g_W = tail.g_W;

    // Covariance of the body's errors to that of the IMU's, then to that of the model's core.
    Matrix15d J;
    body_state(core, rig.T_B_I.inverse(), omega_I, &J);
    const Matrix15d J_inverse = J.inverse();
    const Eigen::Index points = tail.covariance.rows() - 15, m = mount.covariance.rows();
    MatrixXd joint = MatrixXd::Zero(15 + points + m, 15 + points + m);
    joint.topLeftCorner(15 + points, 15 + points) = tail.covariance;
    joint.bottomRightCorner(m, m) = mount.covariance;
    if (mount.with_tail.size() > 0) {
        joint.topRightCorner(15 + points, m) = mount.with_tail;
        joint.bottomLeftCorner(m, 15 + points) = mount.with_tail.transpose();
    }
    joint.topRows<15>() = (J_inverse * joint.topRows<15>()).eval();
    joint.leftCols<15>() = (joint.leftCols<15>() * J_inverse.transpose()).eval();
    CoreMatrix lift;
    FilterState state =
        motion.start(core, joint.topLeftCorner<15, 15>(), at, options.invariant, &lift);
    const int c = state.core_size();
    const Eigen::Index others = points + m;
    MatrixXd lifted(c + others, c + others);
    lifted.topLeftCorner(c, c) = state.core_covariance();
    lifted.topRightCorner(c, others) = lift * joint.topRightCorner(15, others);
    lifted.bottomLeftCorner(others, c) = lifted.topRightCorner(c, others).transpose();
    lifted.bottomRightCorner(others, others) = joint.bottomRightCorner(others, others);

    state.start_mount(mount.mount, mount.covariance);
    state.clone(0);
    const Pose& T_I_C = mount.mount.T_I_C;
    std::vector<LandmarkState> landmarks;
    for (const LandmarkEstimate& from : tail.landmarks) {
        LandmarkState landmark;
        landmark.id = from.id;
        landmark.anchor = 0;
        landmark.point = anchored(from.p_W, core.T_W_I, T_I_C);
        landmark.observations = from.observations;
        landmarks.push_back(landmark);
    }
    state.start_landmarks(landmarks,
                          anchored_covariance(lifted, c, static_cast<int>(m), rate_of(core, at),
                                              core.T_W_I, T_I_C, landmarks));
    state.marginalise(surplus(state, options));
    return state;
}

}  // namespace vio
