// Scenes and pictures of a run on its way.
#pragma once

#include <memory>
#include <string>

#include "gui_offscreen/scene.h"
#include "gui_offscreen/snapshot.h"
#include "libvio/base/estimate.h"
#include "libvio/camera/rig.h"

namespace vio::app {

/// Files scenes/NNNNNN.3Dscene (number of the image) and, where off-screen OpenGL can start, .png.
class SceneSeries {
 public:
    /// every: images between two scenes; 0: none. Scenes of an earlier run are removed.
    SceneSeries(const std::string& results_folder, const Rig& rig, int every);
    ~SceneSeries();

    /// Whether the image with this number (from 1) is to have a scene.
    bool due(long image) const { return every_ > 0 && image % every_ == 0; }
    void write(long image, const Estimate& estimate);
    /// The rig whose camera the scenes from here on show.
    void set_rig(const Rig& rig);

 private:
    std::string folder_;
    SceneOptions options_;
    int every_;
    std::unique_ptr<SnapshotRenderer> renderer_;
};

}  // namespace vio::app
