// Attitude from the direction in which gravity is felt.
#pragma once

#include "libvio/batch/batch.h"

namespace vio {

/// A gyro bias with its covariance [rad/s].
struct GyroBias {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

/// Gravity as the accelerometer feels it over a while, and what else is known at its end.
struct Felt {
    Eigen::Vector3d force = Eigen::Vector3d::Zero();  ///< mean reading, in I at the end [m/s^2]
    /// Share of the accelerometer's bias in it: the mean rotation to I at the end.
    Eigen::Matrix3d bias_share = Eigen::Matrix3d::Identity();
    double force_variance = 0;  ///< of its other errors, for each component [(m/s^2)^2]
    GyroBias gyro;
    double yaw_variance = 0;                              ///< [rad^2]
    double position_variance = 0, velocity_variance = 0;  ///< for each component
    double position_velocity = 0;                         ///< their covariance
};

/// State at the end of that while, with no points. Yaw, position and velocity are zero. The tilt is
/// correlated with the accelerometer's bias, whose prior is BatchOptions::accel_bias_sigma.
BatchTail levelled(const Felt& felt, TimeNs t, const Rig& rig, const BatchOptions& priors);

}  // namespace vio
