// What a run leaves: the results folder, written as the estimate comes, and its picture.
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "app/painter.h"
#include "app/pipeline.h"
#include "app/scene_series.h"
#include "gui_offscreen/scene.h"
#include "libvio/base/estimate.h"
#include "libvio/io/results.h"
#include "libvio/io/results_writer.h"

namespace vio::app {

/// An estimate thinned to what a picture can show, however long it is.
class Sketch {
 public:
    void add(const Estimate& piece);
    const Estimate& estimate();

 private:
    static constexpr std::size_t kMostStates = 4096, kMostLandmarks = 16384;

    Estimate estimate_;
    std::map<FeatureId, LandmarkEstimate> landmarks_;
    long states_ = 0;      // that have come
    long state_step_ = 1;  // one in so many is kept
    std::uint64_t landmark_mask_ = 0;
};

/// Takes images, features and pieces of the estimate in the order in which they come.
class RunOutput {
 public:
    RunOutput(const RunRequest& request, const Rig& rig);

    /// For the landmarks' colours; before its features.
    void add(const ImageMessage& image) { painter_.add(image); }
    /// An image's features have gone to the estimator.
    void add(const FeatureFrame& frame);
    void add(Estimate piece);
    /// The rig as estimated; before the first piece.
    void set_rig(const Rig& rig);
    const WrittenPath& written() const { return writer_.written(); }
    int images_with_pose() const { return images_with_pose_; }
    int images_lost() const { return images_lost_; }  ///< of these
    bool has_scale() { return sketch_.estimate().has_scale; }

    /// Whether a scene is due, and what it shows beside what has been added: landmarks that are
    /// still in the estimator's state.
    bool scene_due() const { return scene_due_; }
    void write_scene(const std::vector<LandmarkEstimate>& landmarks);

    /// Call after the last piece, if there were states.
    void finish(const nlohmann::json& summary);
    /// Returns in one line why there is no picture, or nothing.
    std::string draw(const NamedPath& truth);

 private:
    std::string folder_;
    Rig rig_;
    ResultsWriter writer_;
    std::deque<FeatureFrame> recent_;  // of which the estimator makes key-frames
    long most_recent_;
    std::deque<TimeNs> without_pose_;  // images
    int images_with_pose_ = 0, images_lost_ = 0;
    Painter painter_;
    std::unique_ptr<SceneSeries> scenes_;
    bool scene_due_ = false;
    Sketch sketch_;
};

}  // namespace vio::app
