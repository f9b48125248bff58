// Recursive estimator (section 5 of the paper): multirate iterated extended Kalman filter.
#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "libvio/base/estimate.h"
#include "libvio/base/options.h"
#include "libvio/batch/batch.h"
#include "libvio/camera/rig.h"
#include "libvio/recursive/filter_state.h"
#include "libvio/recursive/status.h"
#include "libvio/tracking/predicted_feature.h"

namespace vio {

/// Form, start and limits of the filter.
struct IekfOptions {
    std::string motion = "imu_driven";      ///< imu_driven | smooth (the paper's)
    std::string consistency = "invariant";  ///< invariant | none
    std::string new_points = "clones";      ///< clones | paper
    double sigma_px = 1.0;
    int max_iterations = 3;
    double gate = 0.999;  ///< probability that a good innovation passes

    std::string start = "auto";  ///< auto | prefix | rest
    int prefix_images = 60;
    double start_velocity_sigma = 0.2;  ///< [m/s], as all limits of velocity in the body frame
    double start_tilt_sigma = 0.1;      ///< [rad]
    double start_wanted_tilt = 2e-3;    ///< sigma [rad] that a start waits for
    double start_scale_sigma = 0.25;    ///< share

    // What is known of the calibration; imu_driven. All of the camera's zero: its mount is exact,
    // else estimated, from what a careful calibration leaves.
    double camera_rotation_sigma = 0.005;  ///< camera on the IMU, about each axis [rad]
    double camera_position_sigma = 0.002;  ///< along each axis [m]
    double time_offset_sigma = 0.005;      ///< of the camera's clock [s]
    double imu_rotation_sigma = 0;         ///< IMU on the body, about each axis [rad]
    double imu_position_sigma = 0;         ///< along each axis [m]

    int clones = 11;
    int max_landmarks = 50;
    int lost_after = 3;            ///< images
    double new_point_sigma = 0.3;  ///< of inverse distance, to what is usual
    int max_window_points = 40;

    double angular_rate_variance = 1e2;    ///< smooth [(rad/s)^2/s]
    double acceleration_variance = 1e2;    ///< smooth [(m/s^2)^2/s]
    double image_rotation_variance = 0.3;  ///< image-only [rad^2/s]
    double image_position_variance = 0.3;  ///< image-only [m^2/s]

    int min_features = 3;               ///< fewer used ones do not hold the motion
    double lost_after_seconds = 0.5;    ///< [s]
    double lost_velocity_sigma = 1;     ///< less certain velocity is not known [m/s]
    double blind_velocity_sigma = 0.2;  ///< the same without points in sight [m/s]
    double usual_speed = 2;             ///< [m/s], beyond which limits of velocity grow with it
    double message_window = 0.1;        ///< [s]
    std::string output = "images";      ///< images | readings: at which there is a state

    void describe(OptionSet& options);
    /// One of the limits of velocity's uncertainty, at a speed [m/s].
    double velocity_limit(double sigma, double speed) const {
        return sigma * std::max(1.0, speed / usual_speed);
    }
};

/// Feed measurements in any order within IekfOptions::message_window; read the trajectory.
///
/// The estimator starts by itself from the batch estimate of a prefix; if that fails or is too
/// uncertain, status() tells the measured value and it tries again with later images.
class Iekf {
 public:
    /// Throws InputError if the rig has no camera.
    Iekf(const Rig& rig, const IekfOptions& options, const BatchOptions& prefix_options,
         bool use_imu = true);
    ~Iekf();

    /// Starts from a known distribution instead of from a prefix. Before any measurement; those
    /// before the state's time are ignored.
    void start(const BatchTail& tail);

    void add(const ImuReading& reading);
    void add(const FeatureFrame& frame);
    /// Call once after the last measurement.
    void finish();

    /// States at all images so far (those of the prefix from its batch estimate), and every
    /// landmark that was ever in the state with its last estimate; without what was taken.
    const Estimate& estimate() const;
    /// The last state, taken or not; null before the start. Valid until the next call of add(),
    /// finish() or take(). Unlike estimate(), costs nothing.
    const StateEstimate* newest() const;
    /// What has become final since the last call: states, and landmarks that have left the state;
    /// after finish() the others too. Memory is bounded if this is called again and again.
    Estimate take();

    /// Features given up since the last call because their innovations failed the gate again and
    /// again: their tracks are wrong.
    std::vector<FeatureId> take_rejected();

    /// Where the landmarks of the state will be seen in an image at time t [ns] on the camera's
    /// clock: the state moved there by the readings that have been added. Nothing while there is no
    /// state, it is lost, or it is later than t.
    std::vector<PredictedFeature> predict(TimeNs t) const;

    /// The last 10000 entries.
    const std::vector<StatusEntry>& status() const;

    /// The rig with the camera's mount and clock as estimated last, and how far that is from what
    /// was stated. Nothing before the start, and where the options say that they are exact. Call
    /// after finish().
    std::optional<RefinedRig> refined_rig() const;

    /// For diagnosis: the filter's state; null before the start.
    const FilterState* state();

 private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace vio
