#include "libvio/recursive/message_queue.h"

#include <algorithm>

namespace vio {

// Both kinds of message are dropped once anything later has been released.
template <typename T, typename Time>
bool MessageQueue::insert(std::deque<T>& queue, T message, Time time,
                          std::optional<TimeNs> released) {
    const TimeNs t = time(message);
    auto at = queue.end();
    while (at != queue.begin() && time(*std::prev(at)) > t) --at;
    const bool twice = at != queue.begin() && time(*std::prev(at)) == t;
    if (twice || (released && t <= *released) || (released_ && t < *released_)) {
        ++dropped_;
        return false;
    }
    queue.insert(at, std::move(message));
    newest_ = std::max(newest_.value_or(t), t);
    return true;
}

bool MessageQueue::add(const ImuReading& reading) {
    return insert(
        readings_, reading, [](const ImuReading& r) { return r.t; }, released_reading_);
}

bool MessageQueue::add(TimedFrame frame) {
    return insert(
        frames_, std::move(frame), [](const TimedFrame& f) { return f.t_imu; }, released_frame_);
}

std::optional<std::variant<ImuReading, TimedFrame>> MessageQueue::pop(bool at_end) {
    if (readings_.empty() && frames_.empty()) return std::nullopt;
    const bool frame_first =
        !frames_.empty() && (readings_.empty() || frames_.front().t_imu <= readings_.front().t);
    const TimeNs t = frame_first ? frames_.front().t_imu : readings_.front().t;
    if (!at_end) {
        if (t > *newest_ - window_) return std::nullopt;
        if (frame_first && needs_readings_ && readings_.empty() && t > *newest_ - kLongestWait)
            return std::nullopt;
    }
    released_ = t;
    if (frame_first) {
        released_frame_ = t;
        TimedFrame frame = std::move(frames_.front());
        frames_.pop_front();
        return frame;
    }
    released_reading_ = t;
    const ImuReading reading = readings_.front();
    readings_.pop_front();
    return reading;
}

}  // namespace vio
