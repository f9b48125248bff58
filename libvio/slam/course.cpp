#include "libvio/slam/course.h"

#include <algorithm>
#include <utility>

#include "libvio/base/timed.h"

namespace vio {
namespace {

// What comes to the estimator is in order but for an image's features, which follow the reading
// that they waited for: its own window must not be nothing.
EstimationRequest with_window(EstimationRequest request) {
    constexpr double kShortest = 1e-6;  // [s]
    request.options.iekf.message_window = std::max(request.options.iekf.message_window, kShortest);
    return request;
}

}  // namespace

Course::Course(const EstimationRequest& request, const Rig& rig)
    : use_imu_(request.use_imu),
      patient_(request.estimator != "iekf"),
      time_offset_(from_seconds(rig.time_offset)),
      queue_(request.options.iekf.message_window, rig, request.use_imu),
      estimator_(make_estimator(with_window(request), rig)),
      front_end_(request.options.tracker, rig, request.use_imu) {
    front_end_.set_predictor([this](TimeNs t) { return estimator_->predict(t); });
}

void Course::add(const Message& message) {
    if (use_imu_ || !std::holds_alternative<ImuReading>(message)) queue_.add(message);
}

bool Course::step(bool at_end) {
    if (const auto message = queue_.pop(at_end)) {
        if (const auto* reading = std::get_if<ImuReading>(&*message)) feed(*reading);
        feed(timed(tracking_s_, [&] { return front_end_.add(*message); }));
        front_end_.end_tracks(estimator_->take_rejected());
        return true;
    }
    if (!at_end || ended_) return false;
    ended_ = true;
    feed(timed(tracking_s_, [&] { return front_end_.finish(); }));
    return true;
}

void Course::finish() {
    while (step(true)) {
    }
    timed(estimation_s_, [&] { estimator_->finish(); });
}

void Course::feed(const ImuReading& reading) {
    if (!first_reading_) first_reading_ = reading.t;
    last_reading_ = reading.t;
    ++counts_.imu_readings;
    timed(estimation_s_, [&] {
        estimator_->add(reading);
        while (!waiting_.empty() && waiting_.front().t + time_offset_ <= last_reading_) release();
    });
}

void Course::feed(const std::vector<FeatureFrame>& frames) {
    for (const FeatureFrame& frame : frames) tracked_(frame);
    timed(estimation_s_, [&] {
        for (const FeatureFrame& frame : frames) hold(frame);
    });
}

void Course::hold(const FeatureFrame& frame) {
    waiting_.push_back(frame);
    if (!use_imu_ || (first_reading_ && frame.t + time_offset_ <= last_reading_)) release();
    while (!patient_ && first_reading_ && !waiting_.empty() &&
           frame.t - waiting_.front().t > MessageQueue<>::kLongestWait)
        release();
}

void Course::release() {
    const FeatureFrame frame = std::move(waiting_.front());
    waiting_.pop_front();
    if (use_imu_ && frame.t + time_offset_ < *first_reading_) {
        ++counts_.dropped_images;
        return;
    }
    constexpr double kGap = 1;  // [s]
    const double since_last = to_seconds(frame.t - counts_.last_image);
    if (counts_.images++ == 0)
        counts_.first_image = frame.t;
    else if (since_last <= kGap)
        counts_.covered_s += since_last;
    counts_.last_image = frame.t;
    estimated_(frame);
    estimator_->add(frame);
}

CourseCounts Course::counts() const {
    CourseCounts counts = counts_;
    if (ended_) counts.dropped_images += static_cast<int>(waiting_.size());
    counts.repeated_messages = queue_.repeated();
    counts.late_messages = queue_.late();
    counts.late_images = queue_.late_images();
    return counts;
}

std::string Course::why_no_pose() const {
    std::string why = estimator_->report();
    if (why.empty() && !estimator_->status().empty()) why = estimator_->status().back().text;
    if (why.empty()) why = "too little to start from; see the images' span";
    const int late = queue_.late();
    return "no pose could be estimated: " + why +
           (late > 0 ? "; " + std::to_string(late) +
                           " messages came later than iekf.message_window and were left out"
                     : "");
}

}  // namespace vio
