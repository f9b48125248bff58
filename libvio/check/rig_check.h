// Whether a calibration can be true.
#pragma once

#include <vector>

#include "libvio/camera/rig.h"
#include "libvio/check/finding.h"

namespace vio {

/// Verdicts on the camera's field of view and model, on the places of camera and IMU, and on the
/// noise. with_imu: the recording has readings.
std::vector<Finding> check_rig(const Rig& rig, bool with_imu);

}  // namespace vio
