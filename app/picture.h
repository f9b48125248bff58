// Scene and snapshot of an estimate, in the results folder.
#pragma once

#include <string>
#include <vector>

#include "gui_offscreen/scene.h"
#include "libvio/base/estimate.h"
#include "libvio/camera/rig.h"

namespace vio::app {

/// What to draw of a run.
struct Drawing {
    SceneOptions options;
    std::vector<NamedPath> others;
    std::string problem;  ///< in one line why the truth is missing (it cannot be aligned), or empty
};

/// The truth (named by its file), if not empty, is drawn beside the estimate, aligned to it.
Drawing drawing_of(const Estimate& estimate, const Rig& rig, const NamedPath& truth);

/// Writes scene.3Dscene and snapshot.png. Returns in one line why there is no snapshot (off-screen
/// OpenGL cannot start) or no truth in it, or nothing. Throws InputError for a full disk.
std::string write_picture(const Estimate& estimate, const Rig& rig, const NamedPath& truth,
                          const std::string& folder);

}  // namespace vio::app
