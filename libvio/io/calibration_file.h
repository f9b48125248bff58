// Calibration files: INI text that overrides or completes what a rawlog carries.
#pragma once

#include <string>

#include "libvio/camera/rig.h"

namespace vio {

/// Overrides the rig with the keys that the file gives (all optional; units in share/formats.md):
///   [camera] model = perspective, width, height, fx, fy, cx, cy, distortion = k1 k2 p1 p2 [k3
///            [k4 k5 k6]], T_B_C = x y z qx qy qz qw
///   [imu]    gyro_noise_density, accel_noise_density, gyro_bias_random_walk,
///            accel_bias_random_walk, gyro_sensitivity_error, T_B_I = x y z qx qy qz qw,
///            time_offset_s
/// Where the rig has no camera, the six intrinsics must be given together. Throws InputError (file,
/// section, key) for a missing file, an unknown section or key, or a value that does not parse.
void load_calibration(const std::string& file, Rig& rig);

/// Text of a calibration file with the whole rig (perspective camera or none).
std::string calibration_text(const Rig& rig);

/// Text of a calibration file with only what a rawlog has no field for: noise densities and time
/// offset.
std::string imu_calibration_text(const Rig& rig);

}  // namespace vio
