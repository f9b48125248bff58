#include "app/run_output.h"

#include <nlohmann/json.hpp>

#include "app/picture.h"

namespace vio::app {
namespace {

std::string effective_options(const RunRequest& request) {
    OptionSet options;
    PipelineOptions effective = request.options;
    effective.describe(options);
    return options.to_ini();
}

// Decides evenly, and always alike, which landmarks to leave out.
std::uint64_t scattered(FeatureId id) {
    const std::uint64_t product = static_cast<std::uint64_t>(id) * 0x9e3779b97f4a7c15ULL;
    return product >> 32;
}

}  // namespace

void Sketch::add(const Estimate& piece) {
    estimate_.g_W = piece.g_W;
    estimate_.gravity_covariance = piece.gravity_covariance;
    estimate_.has_scale = piece.has_scale;
    auto& states = estimate_.states;
    for (const StateEstimate& state : piece.states) {
        if (states_++ % state_step_ != 0) continue;
        states.push_back(state);
        if (states.size() < kMostStates) continue;
        for (std::size_t i = 0; 2 * i < states.size(); ++i) states[i] = states[2 * i];
        states.resize((states.size() + 1) / 2);
        state_step_ *= 2;
    }
    for (const LandmarkEstimate& landmark : piece.landmarks)
        if ((scattered(landmark.id) & landmark_mask_) == 0)
            landmarks_.insert_or_assign(landmark.id, landmark);
    while (landmarks_.size() > kMostLandmarks) {
        landmark_mask_ = 2 * landmark_mask_ + 1;
        std::erase_if(landmarks_,
                      [&](const auto& l) { return (scattered(l.first) & landmark_mask_) != 0; });
    }
}

const Estimate& Sketch::estimate() {
    estimate_.landmarks.clear();
    for (const auto& [id, landmark] : landmarks_) estimate_.landmarks.push_back(landmark);
    return estimate_;
}

RunOutput::RunOutput(const RunRequest& request, const Rig& rig)
    : folder_(request.output),
      rig_(rig),
      writer_(request.output, rig, effective_options(request), request.overwrite) {
    // The filter's prefix is no longer than twice this.
    if (request.estimator == "iekf")
        most_waiting_ = 4 * static_cast<std::size_t>(request.options.iekf.prefix_images);
}

void RunOutput::add(const FeatureFrame& frame) {
    const bool key = keyframes_.takes(frame);
    if (key) writer_.add_keyframe(frame);
    writer_.limit_waiting_keyframes(most_waiting_);
    last_ = key ? std::nullopt : std::optional(frame);
}

void RunOutput::add(const Estimate& piece) {
    writer_.add(piece);
    sketch_.add(piece);
}

void RunOutput::finish(const nlohmann::json& summary) {
    if (last_) writer_.add_keyframe(*last_);
    writer_.finish(summary);
}

std::string RunOutput::draw(const NamedPath& truth) {
    return write_picture(sketch_.estimate(), rig_, truth, folder_);
}

}  // namespace vio::app
