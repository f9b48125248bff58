// Start from the batch estimate of the first images, section 5.2.
#pragma once

#include <algorithm>
#include <deque>
#include <optional>
#include <string>

#include "libvio/batch/batch.h"
#include "libvio/recursive/filter_start.h"
#include "libvio/recursive/iekf.h"
#include "libvio/recursive/start_of_attitude.h"

namespace vio {

/// Standard deviation of the direction of gravity in the body frame [rad].
double tilt_sigma(const StateEstimate& state);

/// Collects measurements until a batch estimate of them can start the filter.
class Prefix {
 public:
    Prefix(const Rig& rig, const IekfOptions& options, const BatchOptions& batch, bool use_imu);

    void add(const ImuReading& reading);
    void add(const FeatureFrame& frame);

    /// What is known of the camera's mount before.
    void set_mount(const MountEstimate& mount);

    int images() const { return static_cast<int>(frames_.size()); }
    TimeNs last_image() const { return frames_.back().t; }
    std::vector<TimeNs> image_times() const;

    /// True when enough images have come since the last attempt. next: see attempt().
    bool ready(const ImuReading* next) const;
    /// Whether an image should have come long before a reading of time t.
    bool image_missing(TimeNs t) const;

    /// What the filter goes on from: the states of the prefix's images and their joint uncertainty.
    struct Start {
        std::vector<StateEstimate> states;
        std::vector<RelativeMotion> keyframe_motions;  ///< the last to the last image
        BatchTail tail;
        MountEstimate mount;
    };
    /// Start at the last image that has readings wherever the time offset may put it; nothing if it
    /// cannot be trusted, with the reason in why(); what follows then is retry_later(). next: the
    /// first reading at or after the last image, if there is one yet.
    std::optional<Start> attempt(const ImuReading* next);
    const std::string& why() const { return why_; }

    /// Whether a start may get much better with more images: the direction of gravity is less
    /// certain than wanted, and the prefix not full.
    bool should_wait(const Start& start) const;

    /// The frame at t, frames after it, readings after t_imu, and the one before these.
    struct Rest {
        FeatureFrame at;
        std::optional<ImuReading> before;
        std::vector<ImuReading> readings;
        std::vector<FeatureFrame> frames;
    };
    Rest after(TimeNs t, TimeNs t_imu) const;

    /// Attitude at the last image, where the path is not to be had; nothing without readings.
    std::optional<AttitudeStart> attitude(const ImuReading* next) const;

    /// True if the oldest images must go to make room for those of the next attempt.
    bool full() const;
    /// The next attempt has half a prefix more of images, up to twice a prefix; then the oldest go.
    void retry_later();

    /// Empties the buffers.
    void clear();

 private:
    std::optional<Start> fail(std::string why);
    void drop_readings(TimeNs t);
    std::size_t covered(const ImuReading* next) const;
    ImuSequence readings(const ImuReading* next) const;
    std::string why_not(const BatchResult& result, const ImuSequence& imu) const;
    int step() const { return std::max(1, options_.prefix_images / 2); }

    Rig rig_;
    MountEstimate mount_;
    TimeNs margin_ = 0;  // by which the time offset may be off
    IekfOptions options_;
    BatchOptions batch_;
    bool use_imu_;
    std::deque<FeatureFrame> frames_;
    std::deque<ImuReading> readings_;
    int next_attempt_;
    std::optional<GyroBias> gyro_bias_;  // of the last attempt
    std::string why_;
};

}  // namespace vio
