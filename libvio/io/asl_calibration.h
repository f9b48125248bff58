// Calibration of an ASL data set: the sensor.yaml files.
#pragma once

#include <mrpt/img/TCamera.h>

#include <string>

#include "libvio/geometry/pose.h"
#include "libvio/imu/noise.h"

namespace vio {

struct AslCamera {
    mrpt::img::TCamera params;
    Pose T_B_C;
};

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

}  // namespace vio
