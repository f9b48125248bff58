// The moving part of the recursive estimator's state.
#pragma once

#include <Eigen/Dense>

#include "libvio/base/estimate.h"
#include "libvio/geometry/pose.h"

namespace vio {

/// Which components the core has. Its error starts with those of StateIndex.
enum class CoreKind : int {
    pose = 6,       ///< rotation, position
    inertial = 15,  ///< and velocity, gyro bias, accelerometer bias
    smooth = 24     ///< and gravity, angular velocity, acceleration: Eq. (13)
};

/// Further components of the core's error, following those of StateIndex.
enum CoreIndex : int { kGravity = 15, kAngularRate = 18, kAcceleration = 21 };

inline constexpr int kMaxCore = 24;
/// Sizes vary between models, storage does not.
using CoreMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxCore, kMaxCore>;
using CoreVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxCore, 1>;

/// At most six measurements of the core at once.
using CoreRows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 6, kMaxCore>;
using CoreResidual = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 6, 1>;

/// Mean of the IMU's motion, of its biases and of gravity.
struct CoreState {
    Pose T_W_I;
    Eigen::Vector3d v_W = Eigen::Vector3d::Zero();         ///< of I's origin [m/s]
    Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();   ///< [rad/s]
    Eigen::Vector3d accel_bias = Eigen::Vector3d::Zero();  ///< [m/s^2]
    Eigen::Vector3d g_W = Eigen::Vector3d::Zero();         ///< [m/s^2]
    Eigen::Vector3d omega_I = Eigen::Vector3d::Zero();     ///< angular velocity (smooth) [rad/s]
    Eigen::Vector3d a_W = Eigen::Vector3d::Zero();         ///< acceleration (smooth) [m/s^2]
};

/// Where the camera sits on the IMU, and its clock: t_imu = t_cam + time_offset. Order of errors:
/// those of T_I_C (as a pose's), the time offset's [s].
struct CameraMount {
    Pose T_I_C;
    double time_offset = 0;
};
inline constexpr int kMountSize = 7, kTimeOffset = 6;

}  // namespace vio
