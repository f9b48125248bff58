// Tells rest from motion: by the spread of the readings against the IMU's noise, and by what the
// features do in the image.
#pragma once

#include <deque>
#include <string>

#include "libvio/base/types.h"
#include "libvio/imu/stillness.h"

namespace vio {

/// Watches the last second (or as much more as images are apart). At rest
/// - the readings are those of an IMU that is still (why_not_still);
/// - the features' displacements from the first image to the last do so for the image noise; their
///   median is asked, since some may be tracked wrongly.
/// Where an image shows nothing, rest is believed to last while the readings say so. Steady motion
/// past points that are too far to move in the image cannot be told from rest.
class RestDetector {
 public:
    RestDetector(const ImuNoise& noise, double sigma_px);

    /// In order of time.
    void add(const ImuReading& reading);
    void add(const FeatureFrame& frame, TimeNs t_imu);

    /// At the newest image.
    bool at_rest() const { return at_rest_; }
    /// Of the stretch from its first image to the newest, if at_rest().
    const Stillness& stillness() const { return stillness_; }
    /// Speed that a departure may have reached within it unnoticed, as a standard deviation [m/s],
    /// for pixels of this angular size [rad] and points at this distance [m].
    double hidden_speed(double pixel, double distance) const;
    /// The measured value against its limit, if not at_rest().
    const std::string& why_not() const { return why_not_; }

 private:
    // An image's features, with their time on the IMU's clock [ns].
    struct TimedFeatures {
        TimeNs t_imu;
        FeatureFrame frame;
    };
    bool judged();
    bool readings_still();
    bool image_still();

    ImuNoise noise_;
    double sigma_px_;
    std::deque<ImuReading> readings_;
    std::deque<TimedFeatures> frames_;
    Stillness stillness_;
    bool at_rest_ = false;
    double hidden_px_ = 0;  // by which all features may have moved together unnoticed
    std::string why_not_ = "too few images and readings";
};

}  // namespace vio
