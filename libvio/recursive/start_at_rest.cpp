#include "libvio/recursive/start_at_rest.h"

#include <algorithm>
#include <cmath>

#include "libvio/base/angles.h"
#include "libvio/base/squared.h"
#include "libvio/geometry/alignment.h"
#include "libvio/recursive/levelled.h"

namespace vio {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;

namespace {

constexpr double kRestVelocity = 0.01;  // [m/s], of what passes for rest
constexpr double kExact = 1e-6;         // [rad], [m], where the world begins
// A less certain position [m] would leave no digits to what is known of motion and points.
constexpr double kAnywhere = 1e4;

}  // namespace

BatchTail start_at_rest(const Stillness& rest, TimeNs t, const Rig& rig,
                        const BatchOptions& priors) {
    const ImuNoise& noise = rig.imu_noise;
    Felt felt;
    felt.force = rest.accel;
    felt.bias_share.setIdentity();
    felt.force_variance = squared(noise.accel_noise_density) / rest.seconds();
    felt.gyro = {rest.gyro,
                 squared(noise.gyro_noise_density) / rest.seconds() * Matrix3d::Identity()};
    felt.yaw_variance = felt.position_variance = squared(kExact);
    felt.velocity_variance = squared(kRestVelocity);
    return levelled(felt, t, rig, priors);
}

BatchTail continued(const BatchTail& start, const Pose& from, const StateEstimate& known) {
    const Similarity S = align_yaw_position(from, known.T_W_B);
    const Vector3d z = Vector3d::UnitZ(), origin = known.T_W_B.p;
    BatchTail tail = start;
    tail.state.T_W_B = S * start.state.T_W_B;
    tail.state.v_W = S.R * start.state.v_W;
    for (LandmarkEstimate& landmark : tail.landmarks) landmark.p_W = S * landmark.p_W;

    const Eigen::Index n = start.covariance.rows();
    MatrixXd turn = MatrixXd::Identity(n, n);
    for (Eigen::Index at = 0; at < n; at += 3)
        if (at == kPosition || at == kVelocity || at >= 15) turn.block<3, 3>(at, at) = S.R;
    // What all share: errors of yaw and position of the world in which they are now.
    MatrixXd shared = MatrixXd::Zero(n, 4);
    const auto moves = [&](Eigen::Index at, const Vector3d& p) {
        shared.block<3, 1>(at, 0) = z.cross(p - origin);
        shared.block<3, 3>(at, 1).setIdentity();
    };
    shared.block<3, 1>(kRotation, 0) = tail.state.T_W_B.R.transpose() * z;
    moves(kPosition, tail.state.T_W_B.p);
    shared.block<3, 1>(kVelocity, 0) = z.cross(tail.state.v_W);
    for (std::size_t i = 0; i < tail.landmarks.size(); ++i)
        moves(15 + 3 * static_cast<Eigen::Index>(i), tail.landmarks[i].p_W);
    Eigen::Matrix<double, 4, 6> M = Eigen::Matrix<double, 4, 6>::Zero();
    M.block<1, 3>(0, 0) = z.transpose() * known.T_W_B.R;
    M.block<3, 3>(1, 3).setIdentity();
    Eigen::Matrix4d common = M * known.covariance.topLeftCorner<6, 6>() * M.transpose();
    for (int i = 0; i < 4; ++i) {
        const double share =
            std::min(1.0, (i == 0 ? kAnyAngle : kAnywhere) / std::sqrt(common(i, i)));
        common.row(i) *= share;
        common.col(i) *= share;
    }
    tail.covariance = turn * start.covariance * turn.transpose();
    tail.covariance += shared * common * shared.transpose();
    tail.covariance = (0.5 * (tail.covariance + tail.covariance.transpose())).eval();
    tail.state.covariance = tail.covariance.topLeftCorner<15, 15>();
    for (std::size_t i = 0; i < tail.landmarks.size(); ++i) {
        const auto at = 15 + 3 * static_cast<Eigen::Index>(i);
        tail.landmarks[i].covariance = tail.covariance.block<3, 3>(at, at);
    }
    return tail;
}

}  // namespace vio
