#include "libvio/recursive/body_frame.h"

#include <algorithm>
#include <cmath>

#include "libvio/geometry/so3.h"

namespace vio {

StateEstimate body_state(const CoreState& core, const Pose& T_I_B, const Eigen::Vector3d& omega_I,
                         Matrix15d* J) {
    const Eigen::Matrix3d& R = core.T_W_I.R;
    const Eigen::Vector3d lever_velocity = omega_I.cross(T_I_B.p);
    StateEstimate body;
    body.T_W_B = core.T_W_I * T_I_B;
    body.v_W = core.v_W + R * lever_velocity;
    body.gyro_bias = core.gyro_bias;
    body.accel_bias = core.accel_bias;
    if (J) {
        J->setIdentity();
        J->topLeftCorner<6, 6>() = right_compose_jacobian(core.T_W_I, T_I_B);
        J->block<3, 3>(kVelocity, kRotation) = -R * so3::skew(lever_velocity);
        J->block<3, 3>(kVelocity, kGyroBias) = R * so3::skew(T_I_B.p);
    }
    return body;
}

CoreState imu_state(const StateEstimate& body, const Pose& T_B_I, const Eigen::Vector3d& omega_I) {
    CoreState core;
    core.T_W_I = body.T_W_B * T_B_I;
    core.v_W = body.v_W - core.T_W_I.R * omega_I.cross(T_B_I.inverse().p);
    core.gyro_bias = body.gyro_bias;
    core.accel_bias = body.accel_bias;
    return core;
}

// R^T v where R has the error theta, v the error dv: R^T v + R^T dv + (R^T v) x theta. But for the
// frame that is the right-invariant filter's own error of velocity.
double velocity_sigma(const Eigen::Matrix3d& R_W_B, const Eigen::Vector3d& v_W,
                      const Eigen::Ref<const Eigen::MatrixXd>& covariance) {
    const Eigen::Matrix3d R_B_W = R_W_B.transpose();
    Eigen::Matrix<double, 3, 9> J = Eigen::Matrix<double, 3, 9>::Zero();
    J.block<3, 3>(0, kRotation) = so3::skew(R_B_W * v_W);
    J.block<3, 3>(0, kVelocity) = R_B_W;
    const Eigen::Matrix3d P = J * covariance.topLeftCorner<9, 9>() * J.transpose();
    return std::sqrt(std::max(0.0, P.diagonal().maxCoeff()));
}

}  // namespace vio
