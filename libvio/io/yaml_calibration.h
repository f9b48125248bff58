// Calibration from YAML: sensor.yaml of ASL data sets (EuRoC, TUM-VI), camchain and imu of Kalibr.
#pragma once

#include <optional>
#include <string>

#include "libvio/camera/rig.h"

namespace vio {

/// Camera, its place in the body frame, and its clock's offset.
struct AslCamera {
    CameraPtr camera;
    Pose T_B_C;
    double time_offset = 0;  ///< timeshift_cam_imu where the file has it [s]
};

/// Noise of the IMU and its place in the body frame.
struct AslImu {
    ImuNoise noise;
    Pose T_B_I;
};

/// Reads camera_model pinhole with distortion_model radial-tangential (radtan, plumb_bob),
/// equidistant (kannala_brandt) or none. All throw InputError (file and key) for a missing file, a
/// missing key, a value of the wrong kind, an unknown model and a T_BS that is no rigid motion.
AslCamera read_asl_camera(const std::string& sensor_yaml);
AslImu read_asl_imu(const std::string& sensor_yaml);
/// T_BS alone.
Pose read_asl_extrinsics(const std::string& sensor_yaml);

/// A rig while files are read that say where its sensors are.
struct StatedRig {
    Rig rig;
    /// The camera on the IMU, where that is what was stated last of the camera's place: T_B_C then
    /// follows when T_B_I is known.
    std::optional<Pose> T_I_C;

    void set_T_B_C(const Pose& T_B_C);
    /// The rig, in whatever order its parts were stated.
    Rig resolved() const;
};

/// Overrides what is stated with what a file of any of these kinds gives; see load_calibration.
/// `camera`: which of a camchain's cameras.
void load_yaml_calibration(const std::string& file, StatedRig& stated,
                           const std::string& camera = "cam0");

}  // namespace vio
