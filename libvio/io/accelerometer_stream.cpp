#include "libvio/io/accelerometer_stream.h"

#include <utility>

namespace vio {
namespace {

// Distance of two readings between which nothing is known of what happened.
constexpr TimeNs kLongestBridge = 100'000'000;

}  // namespace

AccelerometerStream::AccelerometerStream(std::function<std::optional<Reading>()> next)
    : next_(std::move(next)), after_(next_()) {}

std::optional<Eigen::Vector3d> AccelerometerStream::at(TimeNs t) {
    while (after_ && after_->t < t) before_ = std::exchange(after_, next_());
    if (!after_) return {};
    if (after_->t == t) return after_->accel;
    if (!before_) return {};
    const TimeNs gap = after_->t - before_->t;
    if (gap > kLongestBridge) return {};
    const double share = static_cast<double>(t - before_->t) / static_cast<double>(gap);
    return (1 - share) * before_->accel + share * after_->accel;
}

}  // namespace vio
