// Puts measurements into the order of time.
#pragma once

#include <deque>
#include <optional>
#include <variant>

#include "libvio/base/types.h"

namespace vio {

/// An image's features with the time of the image on the IMU's clock.
struct TimedFrame {
    TimeNs t_imu = 0;
    FeatureFrame frame;
};

/// Holds every measurement back until others have arrived that are later by a window of time; those
/// that come later than that, or twice, are counted and dropped.
class MessageQueue {
 public:
    /// How long a frame waits for a reading, at most.
    static constexpr TimeNs kLongestWait = 1'000'000'000;

    /// needs_readings: a frame waits for a reading at its time or after it.
    MessageQueue(TimeNs window, bool needs_readings)
        : window_(window), needs_readings_(needs_readings) {}

    /// False if the message came too late or twice.
    bool add(const ImuReading& reading);
    bool add(TimedFrame frame);

    /// Next message whose turn has come. at_end: no more will be added.
    std::optional<std::variant<ImuReading, TimedFrame>> pop(bool at_end);

    /// Earliest reading that waits.
    const ImuReading* next_reading() const {
        return readings_.empty() ? nullptr : &readings_.front();
    }
    int dropped() const { return dropped_; }

 private:
    template <typename T, typename Time>
    bool insert(std::deque<T>& queue, T message, Time time, std::optional<TimeNs> released);

    TimeNs window_;
    bool needs_readings_;
    std::deque<ImuReading> readings_;
    std::deque<TimedFrame> frames_;
    std::optional<TimeNs> newest_, released_reading_, released_frame_, released_;
    int dropped_ = 0;
};

}  // namespace vio
