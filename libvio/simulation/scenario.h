// A simulated experiment, made of its options by one call.
#pragma once

#include <functional>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "libvio/base/estimate.h"
#include "libvio/camera/rig.h"
#include "libvio/simulation/imu_simulator.h"
#include "libvio/simulation/recorded.h"
#include "libvio/simulation/renderer.h"
#include "libvio/simulation/scenario_options.h"
#include "libvio/simulation/scene.h"
#include "libvio/simulation/stream.h"
#include "libvio/simulation/tracks.h"
#include "libvio/simulation/trajectory.h"
#include "libvio/simulation/vehicle_sensors.h"

namespace vio {

/// A scenario made: everything but the images is held in memory, those are drawn when asked for.
class Simulation {
 public:
    /// Throws InputError where a value makes no sense (section and key).
    explicit Simulation(const ScenarioOptions& options);
    ~Simulation();

    const ScenarioOptions& options() const { return options_; }
    /// True calibration.
    const Rig& rig() const { return rig_; }
    /// Calibration as the rawlog states it, with options().calibration's errors.
    const Rig& stated_rig() const { return stated_rig_; }
    const Trajectory& trajectory() const { return *trajectory_; }
    const Scene& scene() const { return scene_; }
    const Eigen::Vector3d& g_W() const { return g_W_; }

    const std::vector<TimeNs>& image_times() const { return image_times_; }
    /// True state at each image (covariance zero). W's origin is the trajectory's own. With
    /// recorded readings the biases are estimates.
    const std::vector<StateEstimate>& truth() const { return truth_; }
    const std::vector<ImuReading>& imu() const { return imu_.readings; }
    /// The same readings without any error; empty if the readings are recorded.
    const std::vector<ImuReading>& ideal_imu() const { return ideal_imu_; }
    /// What was done to a recorded path for recorded readings; nothing without.
    const std::optional<SmoothedPath>& smoothed_path() const { return smoothed_path_; }
    /// Empty frames unless options().tracks.
    const SimulatedTracks& tracks() const { return tracks_; }

    /// No messages unless asked for.
    const SimulatedOdometry& odometry() const { return odometry_; }
    const SimulatedGps& gps() const { return gps_; }
    /// All messages as they are recorded, by index in image_times(), imu() and so on.
    const std::vector<StreamEntry>& stream() const { return stream_; }

    /// 8-bit grey image.
    cv::Mat image(int image_idx) const;

    /// Nanoseconds of a rawlog stamp and back, t [s] being the trajectory's time. A recorded path
    /// keeps its stamps.
    TimeNs stamp(double t) const;
    double seconds(TimeNs stamp) const;

 private:
    void make_trajectory();
    void make_image_times();
    void make_imu();
    void make_recorded_imu();
    void make_truth();
    void make_vibration();
    void make_tracks();
    void make_vehicle_sensors();
    void make_stream();

    ScenarioOptions options_;
    Rig rig_, stated_rig_;
    Eigen::Vector3d g_W_;
    TimeNs start_ = 0;  ///< stamp of the trajectory's t = 0
    std::unique_ptr<const Trajectory> trajectory_;
    Scene scene_;
    std::vector<TimeNs> image_times_;
    std::vector<StateEstimate> truth_;
    std::vector<ImuReading> ideal_imu_;
    SimulatedImu imu_;
    std::optional<SmoothedPath> smoothed_path_;
    std::vector<CameraPtr> vibrating_;  ///< camera at each image; empty: rig_'s
    SimulatedTracks tracks_;
    SimulatedOdometry odometry_;
    SimulatedGps gps_;
    std::vector<StreamEntry> stream_;
    mutable std::unique_ptr<Renderer>
        renderer_;  ///< made with the first image, or for each that vibrates
};

}  // namespace vio
