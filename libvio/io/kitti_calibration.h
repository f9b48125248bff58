// Calibration of KITTI's raw recordings: calib_imu_to_velo, calib_velo_to_cam, calib_cam_to_cam.
#pragma once

#include <string>

#include "libvio/camera/rig.h"

namespace vio {

/// Rig with B in the OXTS unit, of the camera with this number ("00" to "03"), whose images have
/// this size: the rectified camera if they have its size (S_rect), else the original (S). The noise
/// is that of share/imu/tactical.ini. Throws InputError naming file and key for what is missing or
/// malformed and for a size that is neither camera's.
Rig read_kitti_calibration(const std::string& folder, const std::string& camera, int width,
                           int height);

}  // namespace vio
