// Estimates in the formats of other programs.
#pragma once

#include <string>

#include "libvio/base/estimate.h"

namespace vio {

// What each writes appears complete or not at all, and throws InputError if it cannot be
// written. Numbers of the text files read back to the bit.

/// KITTI odometry: a line for each pose, the twelve numbers of [R_W_B | p_W_B] [m], row by row. (W
/// has z up, and B is the vehicle; KITTI's own poses are those of a camera in its first frame.) The
/// format has neither stamps nor comments: the stamps [s] stand, a line each, in NAME.times.txt
/// beside NAME.txt, whose name is returned; read_trajectory() takes both.
std::string write_kitti(const std::string& file, const Estimate& estimate);

/// EuRoC ground truth: t[ns], position [m], quaternion w x y z, velocity [m/s], gyro bias [rad/s],
/// accelerometer bias [m/s^2], separated by commas.
void write_euroc(const std::string& file, const Estimate& estimate);

/// VRML 2.0 of shape and motion: landmarks as points, the path as a line, and a viewpoint at each
/// of up to 50 poses, through which a viewer can fly. T_B_C: the camera in the body frame.
void write_vrml(const std::string& file, const Estimate& estimate, const Pose& T_B_C);

}  // namespace vio
