// Scene and snapshot of an estimate, in the results folder.
#pragma once

#include <string>

#include "gui_offscreen/scene.h"
#include "libvio/base/estimate.h"
#include "libvio/camera/rig.h"

namespace vio::app {

/// Writes scene.3Dscene and snapshot.png. The truth (named by its file), if not empty, is drawn
/// beside the estimate, aligned to it. Returns in one line why there is no snapshot (off-screen
/// OpenGL cannot start) or no truth in it (it cannot be aligned), or nothing. Throws InputError for
/// a full disk.
std::string write_picture(const Estimate& estimate, const Rig& rig, const NamedPath& truth,
                          const std::string& folder);

}  // namespace vio::app
