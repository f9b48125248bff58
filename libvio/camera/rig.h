// The sensor rig: camera, IMU, where they sit on the vehicle, and their noise.
#pragma once

#include "libvio/camera/camera.h"
#include "libvio/geometry/pose.h"
#include "libvio/imu/noise.h"

namespace vio {

/// Calibration of one camera and one IMU on a vehicle with body frame B.
struct Rig {
    CameraPtr camera;
    Pose T_B_C;  ///< camera in the vehicle frame
    Pose T_B_I;  ///< IMU in the vehicle frame
    ImuNoise imu_noise;
    double time_offset = 0;  ///< [s]: t_imu = t_cam + time_offset

    Pose T_I_C() const { return T_B_I.inverse() * T_B_C; }
};

}  // namespace vio
