// Between the IMU frame, in which the filter works, and the body frame of its output.
#pragma once

#include "libvio/base/estimate.h"
#include "libvio/recursive/filter_state.h"

namespace vio {

/// State of the body from that of the IMU. omega_I: angular velocity, bias removed [rad/s]; its own
/// noise is left out (a lever arm times the gyro noise). J, if given, receives d body / d IMU in
/// StateIndex order.
StateEstimate body_state(const CoreState& core, const Pose& T_I_B, const Eigen::Vector3d& omega_I,
                         Matrix15d* J = nullptr);

/// The inverse, without time and covariance.
CoreState imu_state(const StateEstimate& body, const Pose& T_B_I, const Eigen::Vector3d& omega_I);

/// Largest standard deviation of the velocity's components in the moving frame itself [m/s]: there
/// the error of yaw, which nothing can observe, has no part in it, however fast the motion.
/// covariance: of errors in StateIndex order, at least up to velocity.
double velocity_sigma(const Eigen::Matrix3d& R_W_B, const Eigen::Vector3d& v_W,
                      const Eigen::Ref<const Eigen::MatrixXd>& covariance);

}  // namespace vio
