// A simulated experiment: described by one INI file, made by one call.
#pragma once

#include <functional>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "libvio/base/estimate.h"
#include "libvio/base/options.h"
#include "libvio/camera/rig.h"
#include "libvio/simulation/imu_simulator.h"
#include "libvio/simulation/recorded.h"
#include "libvio/simulation/renderer.h"
#include "libvio/simulation/scenario_camera.h"
#include "libvio/simulation/scenario_motion.h"
#include "libvio/simulation/scene.h"
#include "libvio/simulation/statistics.h"
#include "libvio/simulation/tracks.h"
#include "libvio/simulation/trajectory.h"

namespace vio {

/// Values of a scenario file; describe() gives each one's unit and meaning. Lists are text, numbers
/// separated by blanks.
struct ScenarioOptions {
    std::string name = "scenario";
    std::string include;
    int seed = 1;
    int start_time_s = 1100000000;  ///< stamp of t = 0, UNIX time

    ScenarioMotion motion;  ///< unless recorded_file is given
    std::string recorded_file;
    double recorded_piece_s = 0.05;
    RecordedPathErrors recorded_errors;

    int image_width = 640, image_height = 240;
    std::string intrinsics = "834.18 419.88 317.34 105.30";
    std::string distortion = "-0.290 0.557 -0.00621 -0.00066";
    ScenarioCamera camera;  ///< model, and what belongs to it
    std::string camera_pose = "0 0 0 0 0 180";
    double image_rate = 30;
    double first_image_s = 0;
    int image_count = 0;
    std::string times_file;
    bool render = true;
    RenderOptions rendering;

    std::string scene = "arm_cell", scene_origin = "0 0 0", room_size = "8 6 3";

    std::string imu_pose = "0 0 0 0 0 0";
    double imu_rate = 170, imu_jitter_s = 0, imu_margin_s = 0.1, time_offset_s = 0;
    std::string recorded_imu_file;
    ImuErrors imu;
    double gyro_bias_sigma = 0.01, accel_bias_sigma = 0.1;
    double gyro_scale_sigma = 0, accel_scale_sigma = 0, misalignment_sigma = 0;
    double gravity = 9.81;

    bool tracks = false;
    TrackModel track_model;

    ExperimentStatistics paper;  ///< of the experiment that is imitated

    void describe(OptionSet& options);
    /// Reads a scenario file, after the one that it includes if any, and then the assignments
    /// "section.name=value". Relative names of files count from the folder of the file that has
    /// them. Throws InputError as OptionSet::load and set do.
    static ScenarioOptions from_file(const std::string& ini_file,
                                     const std::vector<std::string>& assignments = {});
};

/// A scenario made: everything but the images is held in memory, those are drawn when asked for.
class Simulation {
 public:
    /// Throws InputError where a value makes no sense (section and key).
    explicit Simulation(const ScenarioOptions& options);
    ~Simulation();

    const ScenarioOptions& options() const { return options_; }
    /// True calibration.
    const Rig& rig() const { return rig_; }
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
    const std::vector<ImuBias>& imu_biases() const { return imu_.biases; }
    /// What was done to a recorded path for recorded readings; nothing without.
    const std::optional<SmoothedPath>& smoothed_path() const { return smoothed_path_; }
    /// Empty frames unless options().tracks.
    const SimulatedTracks& tracks() const { return tracks_; }

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

    ScenarioOptions options_;
    Rig rig_;
    Eigen::Vector3d g_W_;
    TimeNs start_ = 0;  ///< stamp of the trajectory's t = 0
    std::unique_ptr<const Trajectory> trajectory_;
    Scene scene_;
    std::vector<TimeNs> image_times_;
    std::vector<StateEstimate> truth_;
    std::vector<ImuReading> ideal_imu_;
    SimulatedImu imu_;
    std::optional<SmoothedPath> smoothed_path_;
    SimulatedTracks tracks_;
    mutable std::unique_ptr<Renderer> renderer_;  ///< made with the first image
};

}  // namespace vio
