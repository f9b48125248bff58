// Description of a simulated experiment, as in one INI file.
#pragma once

#include <string>
#include <vector>

#include "libvio/base/options.h"
#include "libvio/simulation/imu_simulator.h"
#include "libvio/simulation/recorded.h"
#include "libvio/simulation/renderer.h"
#include "libvio/simulation/scenario_camera.h"
#include "libvio/simulation/scenario_motion.h"
#include "libvio/simulation/statistics.h"
#include "libvio/simulation/stream.h"
#include "libvio/simulation/tracks.h"
#include "libvio/simulation/vehicle_sensors.h"

namespace vio {

/// Spread of the differences between the calibration that the rawlog states and the true one, drawn
/// by the seed. Lists as at the true values; shorter ones are filled with zeros.
struct CalibrationErrors {
    std::string intrinsics_sigma, distortion_sigma;
    double camera_rotation_deg = 0, camera_position = 0;  ///< per axis
    double imu_rotation_deg = 0, imu_position = 0;        ///< per axis
    double time_offset_error = 0;                         ///< stated less true, not random [s]

    void describe(OptionSet& options);
};

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

    OdometryModel odometry;
    GpsModel gps;
    StreamModel messages;
    CalibrationErrors calibration;

    ExperimentStatistics paper;  ///< of the experiment that is imitated

    void describe(OptionSet& options);
    /// Reads a scenario file, after the one that it includes if any, and then the assignments
    /// "section.name=value". Relative names of files count from the folder of the file that has
    /// them. Throws InputError as OptionSet::load and set do.
    static ScenarioOptions from_file(const std::string& ini_file,
                                     const std::vector<std::string>& assignments = {});
};

}  // namespace vio
