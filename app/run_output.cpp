#include "app/run_output.h"

#include <limits>
#include <nlohmann/json.hpp>

#include "app/picture.h"

namespace vio::app {
namespace {

std::string effective_options(const RunRequest& request) {
    OptionSet options;
    EstimationOptions effective = request.options;
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
      writer_(request.output, rig, effective_options(request), request.overwrite),
      // The filter's prefix is no longer than half of this.
      most_recent_(request.estimator == "iekf" ? 4L * request.options.iekf.prefix_images
                                               : std::numeric_limits<long>::max() / 2),
      painter_(most_recent_),
      scenes_(std::make_unique<SceneSeries>(request.output, rig, request.scene_every)) {}

void RunOutput::add(const FeatureFrame& frame) {
    painter_.add(frame);
    recent_.push_back(frame);
    without_pose_.push_back(frame.t);
    if (static_cast<long>(recent_.size()) > most_recent_) recent_.pop_front();
}

void RunOutput::add(Estimate piece) {
    painter_.paint(piece.landmarks);
    for (const RelativeMotion& motion : piece.keyframe_motions)
        for (const TimeNs t : {motion.from, motion.to}) {
            while (!recent_.empty() && recent_.front().t < t) recent_.pop_front();
            if (recent_.empty() || recent_.front().t != t) continue;
            writer_.add_keyframe(recent_.front());
            recent_.pop_front();
        }
    const int before = images_with_pose_;
    for (const StateEstimate& state : piece.states) {
        while (!without_pose_.empty() && without_pose_.front() < state.t) without_pose_.pop_front();
        if (without_pose_.empty() || without_pose_.front() != state.t) continue;
        ++images_with_pose_;
        images_lost_ += state.lost;
        without_pose_.pop_front();
    }
    writer_.add(piece);
    sketch_.add(piece);
    for (int image = before + 1; image <= images_with_pose_; ++image)
        scene_due_ = scene_due_ || scenes_->due(image);
}

void RunOutput::set_rig(const Rig& rig) {
    rig_ = rig;
    writer_.set_rig(rig);
    scenes_->set_rig(rig);
}

void RunOutput::write_scene(const std::vector<LandmarkEstimate>& landmarks) {
    scene_due_ = false;
    Estimate estimate = sketch_.estimate();
    estimate.landmarks.insert(estimate.landmarks.end(), landmarks.begin(), landmarks.end());
    scenes_->write(images_with_pose_, estimate);
}

void RunOutput::finish(const nlohmann::json& summary) {
    writer_.finish(summary);
}

std::string RunOutput::draw(const NamedPath& truth) {
    scenes_.reset();  // its renderer must go before another one comes
    return write_picture(sketch_.estimate(), rig_, truth, folder_);
}

}  // namespace vio::app
