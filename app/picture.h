// Scene and snapshot of an estimate, in the results folder.
#pragma once

#include <string>

#include "libvio/base/estimate.h"
#include "libvio/camera/rig.h"

namespace vio::app {

/// Writes scene.3Dscene and snapshot.png. truth_file, if not empty, is a trajectory that is drawn
/// beside the estimate, aligned to it. Returns why there is no snapshot (one line, where off-screen
/// OpenGL cannot start), or nothing. Throws InputError for a bad truth file or a full disk.
std::string write_picture(const Estimate& estimate, const Rig& rig, const std::string& truth_file,
                          const std::string& folder);

}  // namespace vio::app
