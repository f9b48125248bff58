#include "libvio/tracking/front_end.h"

#include <algorithm>

#include "libvio/tracking/gyro_prediction.h"

namespace vio {

TrackingFrontEnd::TrackingFrontEnd(const TrackerOptions& options, const Rig& rig, bool use_gyro)
    : rig_(rig), use_gyro_(use_gyro), tracker_(options, rig.camera) {}

std::vector<FeatureFrame> TrackingFrontEnd::add(const Message& message) {
    reports_.clear();
    if (const auto* frame = std::get_if<FeatureFrame>(&message)) return {*frame};
    if (const auto* reading = std::get_if<ImuReading>(&message)) {
        if (!use_gyro_) return {};
        add_reading(*reading);
    } else if (const auto* image = std::get_if<ImageMessage>(&message)) {
        waiting_.push_back(*image);
    }
    return track_ready();
}

std::vector<FeatureFrame> TrackingFrontEnd::finish() {
    reports_.clear();
    std::vector<FeatureFrame> frames;
    while (!waiting_.empty()) frames.push_back(track_first());
    return frames;
}

// Readings older than the last tracked image and all that wait are no longer needed, nor any after
// a long time without images.
void TrackingFrontEnd::add_reading(const ImuReading& reading) {
    constexpr TimeNs kLongestGap = 60LL * 1000000000LL;
    imu_.push_back(reading);
    const TimeNs offset = from_seconds(rig_.time_offset);
    if (last_image_)
        imu_.drop_before(std::max(*last_image_ + offset, reading.t - kLongestGap));
    else if (waiting_.empty())
        imu_.drop_before(reading.t - from_seconds(1));
}

bool TrackingFrontEnd::ready(const ImageMessage& image) const {
    const TimeNs t_imu = image.t + from_seconds(rig_.time_offset);
    return !use_gyro_ || static_cast<int>(waiting_.size()) > kMostWaiting ||
           (!imu_.empty() && imu_.readings().back().t >= t_imu);
}

FeatureFrame TrackingFrontEnd::track_first() {
    const ImageMessage image = std::move(waiting_.front());
    waiting_.pop_front();
    std::optional<Eigen::Matrix3d> R_C1_C2;
    if (use_gyro_ && last_image_) R_C1_C2 = camera_rotation(imu_, rig_, *last_image_, image.t);
    last_image_ = image.t;
    FeatureFrame frame =
        tracker_.track(image.t, image.image, R_C1_C2,
                       predictor_ ? predictor_(image.t) : std::vector<PredictedFeature>());
    reports_.push_back(tracker_.report());
    return frame;
}

std::vector<FeatureFrame> TrackingFrontEnd::track_ready() {
    std::vector<FeatureFrame> frames;
    while (!waiting_.empty() && ready(waiting_.front())) frames.push_back(track_first());
    return frames;
}

}  // namespace vio
