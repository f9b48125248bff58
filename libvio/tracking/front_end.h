// From the messages of a recording to feature tracks.
#pragma once

#include <deque>
#include <functional>
#include <vector>

#include "libvio/camera/rig.h"
#include "libvio/imu/integration.h"
#include "libvio/io/recording.h"
#include "libvio/tracking/tracker.h"

namespace vio {

/// Tracks the images of a stream of messages, predicting with the gyro (whose bias the tracker
/// learns from the images). The loop of an application:
///
///     while (auto message = recording.next())
///         for (const FeatureFrame& frame : front_end.add(*message)) use(frame);
///     for (const FeatureFrame& frame : front_end.finish()) use(frame);
///
/// An image waits until the IMU readings cover its time, but never for more than kMostWaiting later
/// images: then it is tracked without prediction.
class TrackingFrontEnd {
 public:
    static constexpr int kMostWaiting = 10;

    /// With use_gyro false, IMU readings are ignored and images do not wait.
    TrackingFrontEnd(const TrackerOptions& options, const Rig& rig, bool use_gyro = true);

    /// Frames that this message completes, in order of time. Frames of features pass unchanged;
    /// messages of other sensors yield nothing.
    std::vector<FeatureFrame> add(const Message& message);

    /// Frames of the images that still wait. Call once after the last message.
    std::vector<FeatureFrame> finish();

    /// See FeatureTracker::end_tracks.
    void end_tracks(const std::vector<FeatureId>& ids) { tracker_.end_tracks(ids); }

    /// What an estimator expects in an image at a time on the camera's clock (Iekf::predict); asked
    /// just before the image is tracked.
    using Predictor = std::function<std::vector<PredictedFeature>(TimeNs)>;
    void set_predictor(Predictor predictor) { predictor_ = std::move(predictor); }

    FeatureTracker& tracker() { return tracker_; }

    /// Of the frames that the last add() or finish() tracked, one each.
    const std::vector<TrackerReport>& reports() const { return reports_; }

 private:
    void add_reading(const ImuReading& reading);
    bool ready(const ImageMessage& image) const;
    FeatureFrame track_first();
    std::vector<FeatureFrame> track_ready();

    Rig rig_;
    bool use_gyro_;
    FeatureTracker tracker_;
    Predictor predictor_;
    ImuSequence imu_;
    std::deque<ImageMessage> waiting_;
    std::optional<TimeNs> last_image_;
    std::vector<TrackerReport> reports_;
};

}  // namespace vio
