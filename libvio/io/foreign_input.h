// What a user may name in place of a rawlog.
#pragma once

#include <string>

namespace vio {

/// Throws InputError for a folder and for a file of another format that recordings come in, with
/// the way from there to a rawlog: data sets in ASL, TUM-VI and KITTI layout, bags of ROS 1 and
/// ROS 2, archives, results folders. Whatever else the path is, passes.
void refuse_foreign_input(const std::string& path);

}  // namespace vio
