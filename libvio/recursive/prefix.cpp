#include "libvio/recursive/prefix.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace vio {
namespace {

std::string printed(const char* format, double a, double b) {
    char text[160];
    std::snprintf(text, sizeof text, format, a, b);
    return text;
}

double velocity_sigma(const StateEstimate& state) {
    return std::sqrt(state.covariance.diagonal().segment<3>(kVelocity).maxCoeff());
}

}  // namespace

double tilt_sigma(const StateEstimate& state) {
    const Eigen::Matrix3d P =
        state.T_W_B.R * state.covariance.topLeftCorner<3, 3>() * state.T_W_B.R.transpose();
    return std::sqrt(std::max(P(0, 0), P(1, 1)));
}

Prefix::Prefix(const Rig& rig, const IekfOptions& options, const BatchOptions& batch, bool use_imu)
    : rig_(rig),
      options_(options),
      batch_(batch),
      use_imu_(use_imu),
      next_attempt_(options.prefix_images) {}

void Prefix::add(const ImuReading& reading) {
    if (frames_.empty()) readings_.clear();  // one before the first image is enough
    readings_.push_back(reading);
}

void Prefix::add(const FeatureFrame& frame) {
    const TimeNs t_imu = frame.t + from_seconds(rig_.time_offset);
    if (use_imu_ && (readings_.empty() || readings_.front().t > t_imu)) return;
    frames_.push_back(frame);
}

std::vector<TimeNs> Prefix::image_times() const {
    std::vector<TimeNs> times;
    for (const FeatureFrame& frame : frames_) times.push_back(frame.t);
    return times;
}

bool Prefix::ready() const {
    return static_cast<int>(frames_.size()) >= next_attempt_;
}

void Prefix::clear() {
    frames_.clear();
    readings_.clear();
    next_attempt_ = options_.prefix_images;
}

// The next attempt has half a prefix more of images, up to twice a prefix; then the oldest go.
std::optional<Prefix::Start> Prefix::fail(std::string why) {
    why_ = std::move(why);
    const int step = std::max(1, options_.prefix_images / 2);
    const int longest = 2 * options_.prefix_images;
    if (next_attempt_ + step > longest) {
        frames_.erase(frames_.begin(), frames_.begin() + std::min(step, images() - 1));
        const TimeNs oldest = frames_.front().t + from_seconds(rig_.time_offset);
        while (readings_.size() > 1 && readings_[1].t <= oldest) readings_.pop_front();
    } else {
        next_attempt_ += step;
    }
    return std::nullopt;
}

std::optional<Prefix::Start> Prefix::attempt(const ImuReading* next) {
    BatchProblem problem;
    problem.rig = rig_;
    problem.frames.assign(frames_.begin(), frames_.end());
    BatchResult result;
    try {
        if (use_imu_) {
            problem.imu = ImuSequence({readings_.begin(), readings_.end()});
            if (next) problem.imu.push_back(*next);
        }
        result = estimate_batch(problem, batch_, std::nullopt, true);
    } catch (const InputError& error) {
        return fail(error.what());
    }
    if (!result.report.converged) return fail("prefix not converged: " + result.report.reason);
    if (!result.tail || result.tail->landmarks.empty())
        return fail("prefix has no landmarks in its last image");
    if (!result.tail->covariance.allFinite()) return fail("prefix has no covariance");
    if (use_imu_) {
        const double velocity = velocity_sigma(result.tail->state);
        if (!(velocity <= options_.start_velocity_sigma))
            return fail(printed("prefix velocity uncertain: sigma %.3g m/s, limit %.3g m/s",
                                velocity, options_.start_velocity_sigma));
        const double tilt = tilt_sigma(result.tail->state);
        if (!(tilt <= options_.start_tilt_sigma))
            return fail(printed("prefix tilt uncertain: sigma %.3g rad, limit %.3g rad", tilt,
                                options_.start_tilt_sigma));
    }
    return Start{std::move(result.estimate.states), std::move(result.estimate.keyframe_motions),
                 std::move(*result.tail)};
}

}  // namespace vio
