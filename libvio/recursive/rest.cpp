#include "libvio/recursive/rest.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <vector>

#include "libvio/base/median.h"

namespace vio {

using Eigen::Vector3d;

namespace {

constexpr double kShortest = 1.0, kLongest = 4.0;  // [s] of the stretch that is judged
constexpr int kFewestFeatures = 5;
constexpr double kMedianAtRest = 1.39, kMedianSpreads = 4;  // of chi-square with two degrees

}  // namespace

RestDetector::RestDetector(const ImuNoise& noise, double sigma_px)
    : noise_(noise), sigma_px_(sigma_px) {}

void RestDetector::add(const ImuReading& reading) {
    readings_.push_back(reading);
    const TimeNs oldest = reading.t - from_seconds(kLongest);
    while (readings_.front().t < oldest) readings_.pop_front();
}

void RestDetector::add(const FeatureFrame& frame, TimeNs t_imu) {
    frames_.push_back({t_imu, frame});
    const auto spans = [&](std::size_t i) { return to_seconds(t_imu - frames_[i].t_imu); };
    while (frames_.size() > 1 && (spans(1) >= kShortest || spans(0) > kLongest))
        frames_.pop_front();
    at_rest_ = judged();
}

// On average over its way it was half as fast as in the end.
double RestDetector::hidden_speed(double pixel, double distance) const {
    return 2 * hidden_px_ * pixel * distance / stillness_.seconds();
}

bool RestDetector::judged() {
    if (to_seconds(frames_.back().t_imu - frames_.front().t_imu) < kShortest) {
        why_not_ = "too few images";
        return false;
    }
    stillness_ = {};
    stillness_.from = frames_.front().t_imu;
    stillness_.to = frames_.back().t_imu;
    return readings_still() && image_still();
}

bool RestDetector::readings_still() {
    std::vector<ImuReading> inside;
    for (const ImuReading& reading : readings_)
        if (reading.t >= stillness_.from && reading.t <= stillness_.to) inside.push_back(reading);
    why_not_ = why_not_still(inside, noise_, stillness_);
    return why_not_.empty();
}

bool RestDetector::image_still() {
    std::map<FeatureId, const FeatureObservation*> first;
    for (const FeatureObservation& f : frames_.front().frame.features) first[f.feature_id] = &f;
    std::vector<double> squared, variances;
    for (const FeatureObservation& f : frames_.back().frame.features) {
        const auto before = first.find(f.feature_id);
        if (before == first.end()) continue;
        const Eigen::Vector2d d = f.uv_px - before->second->uv_px;
        const Eigen::Matrix2d C = f.covariance_shape + before->second->covariance_shape;
        squared.push_back(d.dot(C.inverse() * d) / (sigma_px_ * sigma_px_));
        variances.push_back(C.trace() / 2 * sigma_px_ * sigma_px_);
    }
    if (static_cast<int>(squared.size()) < kFewestFeatures) {
        why_not_ = "too few features in common";
        // Nothing to be seen is no motion; features that are gone may be.
        return at_rest_ && static_cast<int>(frames_.back().frame.features.size()) < kFewestFeatures;
    }
    const double middle = median(squared);
    const double limit =
        kMedianAtRest * (1 + kMedianSpreads / std::sqrt(static_cast<double>(squared.size())));
    // Shifted by s standard deviations, all of them have a median greater by about s^2: hidden is
    // any shift up to that of the limit, alike.
    hidden_px_ = std::sqrt(median(std::move(variances)) * (limit - kMedianAtRest) / 3);
    if (middle < limit) return true;
    char text[160];
    std::snprintf(text, sizeof text, "features moved by %.3g sigma in %.2f s, limit %.3g",
                  std::sqrt(middle), stillness_.seconds(), std::sqrt(limit));
    why_not_ = text;
    return false;
}

}  // namespace vio
