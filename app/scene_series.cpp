#include "app/scene_series.h"

#include <cstdio>
#include <filesystem>

#include "app/picture.h"
#include "libvio/base/errors.h"

namespace vio::app {

SceneSeries::SceneSeries(const std::string& results_folder, const Rig& rig, int every)
    : folder_(results_folder + "/scenes"), every_(every) {
    set_rig(rig);
    if (every == 0) return;
    std::error_code error;
    std::filesystem::remove_all(folder_, error);
    std::filesystem::create_directories(folder_, error);
    if (error) throw InputError(folder_ + ": cannot be made (" + error.message() + ")");
}

SceneSeries::~SceneSeries() = default;

void SceneSeries::set_rig(const Rig& rig) {
    options_ = drawing_of({}, rig, {}).options;
}

void SceneSeries::write(long image, const Estimate& estimate) {
    if (!renderer_) renderer_ = std::make_unique<SnapshotRenderer>(1280, 720);
    char name[32];
    std::snprintf(name, sizeof name, "/%06ld", image);
    const auto scene = build_scene(estimate, options_);
    save_scene(*scene, folder_ + name + ".3Dscene");
    const Snapshot snapshot = renderer_->render(scene, {});
    if (snapshot.problem.empty()) save_image(snapshot.image, folder_ + name + ".png");
}

}  // namespace vio::app
