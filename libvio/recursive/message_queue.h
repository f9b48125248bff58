// Puts measurements into the order of time.
#pragma once

#include <algorithm>
#include <deque>
#include <iterator>
#include <optional>
#include <utility>
#include <variant>
#include <vector>

#include "libvio/base/types.h"

namespace vio {

/// An image's features with the time of the image on the IMU's clock.
struct TimedFrame {
    TimeNs t_imu = 0;
    FeatureFrame frame;
};

/// Holds every measurement back until others have arrived that are later by a window of time; those
/// that come later than that, or twice, are counted and dropped. Image: what there is of an image,
/// with its time t_imu on the IMU's clock.
template <typename Image = TimedFrame>
class MessageQueue {
 public:
    /// How long an image waits for a reading, at most.
    static constexpr TimeNs kLongestWait = 1'000'000'000;

    /// needs_readings: an image waits for a reading at its time or after it.
    MessageQueue(TimeNs window, bool needs_readings)
        : window_(window), needs_readings_(needs_readings) {}

    /// False if the message came too late or twice.
    bool add(const ImuReading& reading) {
        return insert(
            readings_, reading, [](const ImuReading& r) { return r.t; }, released_reading_);
    }
    bool add(Image image) {
        return insert(
            images_, std::move(image), [](const Image& i) { return i.t_imu; }, released_image_);
    }

    /// Next message whose turn has come. at_end: no more will be added.
    std::optional<std::variant<ImuReading, Image>> pop(bool at_end) {
        if (readings_.empty() && images_.empty()) return std::nullopt;
        const bool image_first =
            !images_.empty() && (readings_.empty() || images_.front().t_imu <= readings_.front().t);
        const TimeNs t = image_first ? images_.front().t_imu : readings_.front().t;
        if (!at_end) {
            if (t > *newest_ - window_) return std::nullopt;
            if (image_first && needs_readings_ && readings_.empty() && t > *newest_ - kLongestWait)
                return std::nullopt;
        }
        released_ = t;
        return image_first ? release(images_, released_image_)
                           : release(readings_, released_reading_);
    }

    /// Moves the images that wait in time.
    void shift_images(TimeNs by) {
        for (Image& image : images_) image.t_imu += by;
    }
    /// Takes messages back that were released, the latest of them, each kind in order of time.
    void put_back(const std::vector<ImuReading>& readings, std::vector<Image> images) {
        readings_.insert(readings_.begin(), readings.begin(), readings.end());
        images_.insert(images_.begin(), std::make_move_iterator(images.begin()),
                       std::make_move_iterator(images.end()));
    }
    /// Time of the last message released, if any was.
    std::optional<TimeNs> released() const { return released_; }

    /// Readings that wait, in order of time.
    const std::deque<ImuReading>& readings() const { return readings_; }
    /// Earliest reading that waits.
    const ImuReading* next_reading() const {
        return readings_.empty() ? nullptr : &readings_.front();
    }
    int late() const { return late_; }
    int repeated() const { return repeated_; }

 private:
    template <typename T>
    std::variant<ImuReading, Image> release(std::deque<T>& queue, std::optional<TimeNs>& last) {
        last = released_;
        T message = std::move(queue.front());
        queue.pop_front();
        return message;
    }

    // Either kind of message is dropped once anything later has been released.
    template <typename T, typename Time>
    bool insert(std::deque<T>& queue, T message, Time time, std::optional<TimeNs> last) {
        const TimeNs t = time(message);
        auto at = queue.end();
        while (at != queue.begin() && time(*std::prev(at)) > t) --at;
        if ((at != queue.begin() && time(*std::prev(at)) == t) || last == t) {
            ++repeated_;
            return false;
        }
        if ((last && t < *last) || (released_ && t < *released_)) {
            ++late_;
            return false;
        }
        queue.insert(at, std::move(message));
        newest_ = std::max(newest_.value_or(t), t);
        return true;
    }

    TimeNs window_;
    bool needs_readings_;
    std::deque<ImuReading> readings_;
    std::deque<Image> images_;
    std::optional<TimeNs> newest_, released_reading_, released_image_, released_;
    int late_ = 0, repeated_ = 0;
};

}  // namespace vio
