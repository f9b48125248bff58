#include "libvio/recursive/levelled.h"

#include <cmath>

#include "libvio/base/squared.h"
#include "libvio/geometry/so3.h"
#include "libvio/recursive/body_frame.h"

namespace vio {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

constexpr double kFirstTilt = 1.0;  // [rad], before gravity is seen

// The attitude without yaw whose z axis points along the specific force f_B.
Matrix3d level_attitude(const Vector3d& f_B) {
    const double roll = std::atan2(f_B.y(), f_B.z());
    const double pitch = std::atan2(-f_B.x(), std::hypot(f_B.y(), f_B.z()));
    return (Eigen::AngleAxisd(pitch, Vector3d::UnitY()) *
            Eigen::AngleAxisd(roll, Vector3d::UnitX()))
        .toRotationMatrix();
}

}  // namespace

BatchTail levelled(const Felt& felt, TimeNs t, const Rig& rig, const BatchOptions& priors) {
    CoreState core;
    core.g_W = {0, 0, -priors.gravity_norm};
    core.gyro_bias = felt.gyro.mean;
    core.T_W_I = Pose{level_attitude(rig.T_B_I.R * felt.force), Vector3d::Zero()} * rig.T_B_I;

    // f = R^T (-g) + M b + noise, in the errors (rotation in I, bias).
    const Matrix3d& R = core.T_W_I.R;
    const Vector3d predicted = R.transpose() * -core.g_W, up = R.transpose() * Vector3d::UnitZ();
    Eigen::Matrix<double, 3, 6> H;
    H << so3::skew(predicted), felt.bias_share;
    Matrix6d information = Matrix6d::Zero();
    information.topLeftCorner<3, 3>() =
        Matrix3d::Identity() / squared(kFirstTilt) + up * up.transpose() / felt.yaw_variance;
    information.bottomRightCorner<3, 3>() = Matrix3d::Identity() / squared(priors.accel_bias_sigma);
    information += H.transpose() * H / felt.force_variance;
    const Matrix6d C = information.inverse();
    const Vector6d d = C * (H.transpose() * (felt.force - predicted)) / felt.force_variance;
    core.T_W_I.R = R * so3::exp(d.head<3>());
    core.accel_bias = d.tail<3>();

    Matrix15d P = Matrix15d::Zero();
    P.block<3, 3>(kRotation, kRotation) = C.topLeftCorner<3, 3>();
    P.block<3, 3>(kRotation, kAccelBias) = C.topRightCorner<3, 3>();
    P.block<3, 3>(kAccelBias, kRotation) = C.bottomLeftCorner<3, 3>();
    P.block<3, 3>(kAccelBias, kAccelBias) = C.bottomRightCorner<3, 3>();
    P.diagonal().segment<3>(kVelocity).setConstant(felt.velocity_variance);
    P.block<3, 3>(kGyroBias, kGyroBias) = felt.gyro.covariance;
    BatchTail tail;
    Matrix15d J;
    tail.state = body_state(core, rig.T_B_I.inverse(), Vector3d::Zero(), &J);
    tail.state.t = t;
    // Positions count from the body.
    P = (J * P * J.transpose()).eval();
    P.middleRows<3>(kPosition).setZero();
    P.middleCols<3>(kPosition).setZero();
    P.diagonal().segment<3>(kPosition).setConstant(felt.position_variance);
    P.block<3, 3>(kPosition, kVelocity).diagonal().setConstant(felt.position_velocity);
    P.block<3, 3>(kVelocity, kPosition).diagonal().setConstant(felt.position_velocity);
    tail.state.T_W_B.p.setZero();
    tail.state.covariance = 0.5 * (P + P.transpose());
    tail.covariance = tail.state.covariance;
    tail.g_W = core.g_W;
    return tail;
}

}  // namespace vio
