// The messages of a recording in the order of time, for all who track its images.
#pragma once

#include <optional>

#include "libvio/camera/rig.h"
#include "libvio/io/recording.h"
#include "libvio/recursive/message_queue.h"

namespace vio {

/// Holds readings, images and features back for a window of time and gives them in order, on the
/// IMU's clock; what comes later than that, or twice, is left out and counted.
class OrderedMessages {
 public:
    /// window: IekfOptions::message_window [s]. needs_readings: an image waits for a reading at its
    /// time or after it (MessageQueue::kLongestWait at most).
    OrderedMessages(double window, const Rig& rig, bool needs_readings)
        : time_offset_(from_seconds(rig.time_offset)),
          queue_(from_seconds(window), needs_readings) {}

    /// False for messages of other sensors, which have no place here.
    bool add(const Message& message);
    /// Next message whose turn has come. at_end: no more will be added.
    std::optional<Message> pop(bool at_end = false);

    int repeated() const { return queue_.repeated(); }
    int late() const { return queue_.late(); }
    int late_images() const { return late_images_; }  ///< or their features; of late()

 private:
    // An image, or its features, on the IMU's clock.
    struct TimedMessage {  // NOLINT(bugprone-exception-escape): std::variant's own promise
        TimeNs t_imu = 0;
        Message message;
    };

    TimeNs time_offset_;
    MessageQueue<TimedMessage> queue_;
    int late_images_ = 0;
};

}  // namespace vio
