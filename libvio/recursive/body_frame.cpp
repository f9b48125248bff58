#include "libvio/recursive/body_frame.h"

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

}  // namespace vio
