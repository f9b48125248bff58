// Calibration files: INI text that overrides or completes what a rawlog carries.
#pragma once

#include <string>
#include <vector>

#include "libvio/camera/rig.h"

namespace vio {

/// Overrides the rig with what the file gives. Throws InputError (file, section, key) for a missing
/// file, an unknown section or key, or a value that does not parse. Kinds of file, by content:
/// - this project's INI (keys and units: share/formats.md): any key may be left out that the rig's
///   camera, of the same model, has already;
/// - MRPT's INI, a section as TCamera::saveToConfigFile writes it: intrinsics alone;
/// - sensor.yaml of an ASL data set, of a camera or an IMU: intrinsics or noise, and T_BS;
/// - Kalibr's camchain (cam0; T_cam_imu is taken with the rig's T_B_I, timeshift_cam_imu) and
///   imu.yaml (noise).
void load_calibration(const std::string& file, Rig& rig);

/// The same of several files, each of which overrides those before it, key by key. T_B_C and
/// T_cam_imu both say where the camera is: the later one counts, and T_cam_imu is taken with the
/// T_B_I that is known after the last file. Where the camera is thus does not hang on the order of
/// files of which no two state the same. Where it throws, the rig is left as it was.
void load_calibrations(const std::vector<std::string>& files, Rig& rig);

/// Text of a calibration file with the whole rig, T_B_C and T_B_I with their inverses as comments.
std::string calibration_text(const Rig& rig);

/// Text of a calibration file with the IMU's noise densities and random walks alone: what a
/// recording at rest tells.
std::string noise_text(const ImuNoise& noise);

/// Text of a calibration file with the camera's intrinsics alone.
std::string camera_text(const Rig& rig);

/// The intrinsics alone, as "key = value" in one line.
std::string camera_summary(const Camera& camera);

/// Text of the file beside a rawlog, with only what the rawlog has no field for: noise densities,
/// time offset and, if asked for, the camera.
std::string sidecar_text(const Rig& rig, bool with_camera);

}  // namespace vio
