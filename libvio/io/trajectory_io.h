// Trajectories as text: TUM (read and written), EuRoC ground truth, KITTI and MRPT (read).
#pragma once

#include <string>
#include <vector>

#include "libvio/base/estimate.h"
#include "libvio/base/types.h"
#include "libvio/geometry/pose.h"

namespace vio {

/// Reads a trajectory in order of time, plain or gzip-compressed, in the layout that its first row
/// has:
/// - TUM text: `t[s] x y z qx qy qz qw`, separated by blanks; the decimal stamp is taken exactly;
/// - EuRoC CSV: `t[ns],x,y,z,qw,qx,qy,qz[,more columns]`, whose other columns are not read;
/// - MRPT's CPose3DInterpolator: `t[s] x y z yaw pitch roll`, separated by blanks;
/// - KITTI: the 12 numbers of the 3x4 matrix, row by row, with the times [s] in NAME.times.txt
///   beside NAME.txt or in times.txt.
/// Lines that begin with # or % are comments. Throws InputError (file and line) for a missing or
/// empty file, a malformed row, a quaternion that is not of unit length within 1 %, and stamps that
/// do not increase.
std::vector<TimedPose> read_trajectory(const std::string& file);

/// Where the times of KITTI's poses stand: NAME.times.txt beside NAME.txt.
std::string kitti_times_file(const std::string& poses_file);

/// The poses of an estimate.
std::vector<TimedPose> trajectory(const Estimate& estimate);

/// Writes TUM text with a header line; stamps have nine decimals and are exact, coordinates read
/// back to the bit. `frames` says in the header what the poses are, e.g. "T_W_B, ground truth".
/// The file appears complete or not at all. Throws InputError if it cannot be written.
void write_tum(const std::string& file, const std::vector<TimedPose>& poses,
               const std::string& frames);
/// The parts of such a text, for one that grows.
std::string tum_header(const std::string& frames);
std::string tum_row(const TimedPose& pose);

}  // namespace vio
