// Lists of numbers and poses in the text of a scenario file.
#pragma once

#include <string>
#include <vector>

#include "libvio/geometry/pose.h"

namespace vio {

/// Numbers separated by blanks. Throws InputError, naming the option as "[section] key".
std::vector<double> numbers_in(const std::string& text, const std::string& option);
/// The same, of a given count.
std::vector<double> numbers_in(const std::string& text, const std::string& option, size_t count);

/// From x y z [m] yaw pitch roll [deg], R = Rz(yaw) Ry(pitch) Rx(roll) as MRPT's CPose3D.
Pose pose_from(const double* values);
Pose pose_option(const std::string& text, const std::string& option);

}  // namespace vio
