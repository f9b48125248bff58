// The kinds of calibration that `vio-slam calibrate` makes; each in its own file, declared as the
// sub-commands of the program are.
#pragma once

#include <CLI/CLI.hpp>

#include "libvio/geometry/pose.h"

namespace vio::app {

void add_calibrate_mirror(CLI::App& calibrate);
void add_calibrate_camera(CLI::App& calibrate);
void add_calibrate_imu(CLI::App& calibrate);
void add_calibrate_imu_camera(CLI::App& calibrate);

/// One line: name, position, quaternion of a transformation.
void print_transform(const char* name, const Pose& T);

}  // namespace vio::app
