// What a run leaves: the results folder, written as the estimate comes, and its picture.
#pragma once

#include <deque>
#include <limits>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "app/pipeline.h"
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

class RunOutput {
 public:
    RunOutput(const RunRequest& request, const Rig& rig);

    /// An image's features have gone to the estimator.
    void add(const FeatureFrame& frame);
    void add(const Estimate& piece);
    const WrittenPath& written() const { return writer_.written(); }
    bool has_scale() { return sketch_.estimate().has_scale; }

    /// Call after the last piece, if there were states.
    void finish(const nlohmann::json& summary);
    /// Returns in one line why there is no picture, or nothing.
    std::string draw(const NamedPath& truth);

 private:
    std::string folder_;
    Rig rig_;
    ResultsWriter writer_;
    std::deque<FeatureFrame> recent_;  // of which the estimator makes key-frames
    std::size_t most_recent_ = std::numeric_limits<std::size_t>::max();
    Sketch sketch_;
};

}  // namespace vio::app
