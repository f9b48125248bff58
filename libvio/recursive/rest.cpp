#include "libvio/recursive/rest.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <vector>

#include "libvio/base/median.h"
#include "libvio/recursive/observation.h"

namespace vio {

using Eigen::Vector3d;

namespace {

constexpr double kShortest = 1.0, kLongest = 4.0;  // [s] of the stretch that is judged
constexpr double kLargestGap = 0.1;                // [s] between readings
constexpr int kFewestReadings = 20;
constexpr int kQuarters = 4;
constexpr double kLatest = 0.1;  // [s] at the end, judged on their own: motion that has just begun
// Densities are rarely known better than by this factor of their squares; nor is a vehicle at rest
// free of vibration.
constexpr double kNoiseMargin = 2.25;
constexpr double kProbability = 0.999;
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

bool RestDetector::moves(const char* what, double statistic, int degrees) {
    const double limit = kNoiseMargin * chi_square_quantile(degrees, kProbability);
    if (statistic < limit) return false;
    char text[160];
    std::snprintf(text, sizeof text, "%s %.3g times that of noise, limit %.3g", what,
                  statistic / degrees, limit / degrees);
    why_not_ = text;
    return true;
}

bool RestDetector::readings_still() {
    struct Sum {
        Vector3d gyro = Vector3d::Zero(), accel = Vector3d::Zero();
        int count = 0;
    };
    Sum all, latest, quarter[kQuarters];
    std::vector<const ImuReading*> inside;
    for (const ImuReading& reading : readings_) {
        if (reading.t < stillness_.from || reading.t > stillness_.to) continue;
        if (!inside.empty() && to_seconds(reading.t - inside.back()->t) > kLargestGap) break;
        inside.push_back(&reading);
        const double share = to_seconds(reading.t - stillness_.from) / stillness_.seconds();
        Sum& part = quarter[std::min(kQuarters - 1, static_cast<int>(kQuarters * share))];
        const bool late = to_seconds(stillness_.to - reading.t) < kLatest;
        for (Sum* sum : {&all, &part, late ? &latest : nullptr}) {
            if (!sum) continue;
            sum->gyro += reading.gyro;
            sum->accel += reading.accel;
            ++sum->count;
        }
    }
    const bool covered =
        all.count >= kFewestReadings && latest.count > 0 &&
        to_seconds(inside.front()->t - stillness_.from) < kLargestGap &&
        to_seconds(stillness_.to - inside.back()->t) < kLargestGap &&
        std::all_of(quarter, quarter + kQuarters, [](const Sum& q) { return q.count > 0; });
    if (!covered) {
        why_not_ = "too few readings";
        return false;
    }
    stillness_.gyro = all.gyro / all.count;
    stillness_.accel = all.accel / all.count;
    const double rate = (all.count - 1) / to_seconds(inside.back()->t - inside.front()->t);
    const double gyro_variance = noise_.gyro_noise_density * noise_.gyro_noise_density * rate;
    const double accel_variance = noise_.accel_noise_density * noise_.accel_noise_density * rate;
    double gyro = 0, accel = 0, slow_gyro = 0, slow_accel = 0;
    for (const ImuReading* reading : inside) {
        gyro += (reading->gyro - stillness_.gyro).squaredNorm() / gyro_variance;
        accel += (reading->accel - stillness_.accel).squaredNorm() / accel_variance;
    }
    const auto apart = [](const Vector3d& sum, const Vector3d& mean, int count, double variance) {
        return count * (sum / count - mean).squaredNorm() / variance;
    };
    for (const Sum& q : quarter) {
        slow_gyro += apart(q.gyro, stillness_.gyro, q.count, gyro_variance);
        slow_accel += apart(q.accel, stillness_.accel, q.count, accel_variance);
    }
    const double gyro_now = apart(latest.gyro, stillness_.gyro, latest.count, gyro_variance);
    const double accel_now = apart(latest.accel, stillness_.accel, latest.count, accel_variance);
    return !moves("spread of the gyro", gyro, 3 * (all.count - 1)) &&
           !moves("spread of the accelerometer", accel, 3 * (all.count - 1)) &&
           !moves("slow change of the gyro", slow_gyro, 3 * (kQuarters - 1)) &&
           !moves("slow change of the accelerometer", slow_accel, 3 * (kQuarters - 1)) &&
           !moves("latest change of the gyro", gyro_now, 3) &&
           !moves("latest change of the accelerometer", accel_now, 3);
}

bool RestDetector::image_still() {
    std::map<FeatureId, const FeatureObservation*> first;
    for (const FeatureObservation& f : frames_.front().frame.features) first[f.feature_id] = &f;
    std::vector<double> squared;
    for (const FeatureObservation& f : frames_.back().frame.features) {
        const auto before = first.find(f.feature_id);
        if (before == first.end()) continue;
        const Eigen::Vector2d d = f.uv_px - before->second->uv_px;
        const Eigen::Matrix2d C = f.covariance_shape + before->second->covariance_shape;
        squared.push_back(d.dot(C.inverse() * d) / (sigma_px_ * sigma_px_));
    }
    if (static_cast<int>(squared.size()) < kFewestFeatures) {
        why_not_ = "too few features in common";
        // Nothing to be seen is no motion; features that are gone may be.
        return at_rest_ && static_cast<int>(frames_.back().frame.features.size()) < kFewestFeatures;
    }
    const double middle = median(squared);
    const double limit =
        kMedianAtRest * (1 + kMedianSpreads / std::sqrt(static_cast<double>(squared.size())));
    if (middle < limit) return true;
    char text[160];
    std::snprintf(text, sizeof text, "features moved by %.3g sigma in %.2f s, limit %.3g",
                  std::sqrt(middle), stillness_.seconds(), std::sqrt(limit));
    why_not_ = text;
    return false;
}

}  // namespace vio
