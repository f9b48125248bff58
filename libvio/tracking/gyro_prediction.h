// Rotation of the camera between two images, from the gyro.
#pragma once

#include <Eigen/Dense>
#include <optional>

#include "libvio/camera/rig.h"
#include "libvio/imu/integration.h"

namespace vio {

/// R_C1_C2 = R_C_I R_I1_I2 R_I_C, where R_I1_I2 integrates the gyro readings without bias [rad/s]
/// between the camera's times t1 and t2 (each moved by the rig's time offset onto the IMU's clock).
/// Nothing if the readings do not cover the interval or t2 < t1.
std::optional<Eigen::Matrix3d> camera_rotation(
    const ImuSequence& imu, const Rig& rig, TimeNs t1, TimeNs t2,
    const Eigen::Vector3d& gyro_bias = Eigen::Vector3d::Zero());

}  // namespace vio
