// The main job from end to end: a rawlog in, a results folder out.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "app/part.h"
#include "libvio/check/finding.h"
#include "libvio/io/recording.h"
#include "libvio/slam/estimator.h"

namespace vio::app {

/// A run as asked for on the command line; times in seconds, files by path.
struct RunRequest {
    std::string rawlog;
    RecordingOptions recording;
    std::string estimator = "iekf";  ///< batch | iekf
    bool use_imu = true;             ///< false: from images alone
    std::string output;              ///< results folder
    bool overwrite = false;          ///< results that are in the folder already
    int scene_every = 0;             ///< images between scenes that are written on the way; 0: none
    std::string truth_file;          ///< drawn into the picture; empty: none
    std::string fiducials_file;      ///< known points for the batch estimator; empty: none
    std::string start_folder;        ///< results that the batch estimate starts from; empty: none
    PartRequest part;
    EstimationOptions options;
    /// Receives what is wrong with the recording's first seconds, as soon as these are read.
    std::function<void(const Finding&)> warn = [](const Finding&) {};
    /// Receives what else is to be known of the recording, a line each.
    std::function<void(const std::string&)> remark = [](const std::string&) {};
};

/// What a run did, for people and for summary.json.
struct RunReport {
    int images = 0;             ///< that reached the estimator
    int images_with_pose = 0;   ///< of these
    int images_lost = 0;        ///< of these, track lost
    int dropped_images = 0;     ///< outside the IMU's readings
    int repeated_messages = 0;  ///< left out: of the same stamp as another of their kind
    int late_messages = 0;      ///< left out: later than IekfOptions::message_window
    int late_images = 0;        ///< of these
    int imu_readings = 0;
    double duration_s = 0;  ///< from the first to the last of these images
    double covered_s = 0;   ///< of this, without gaps: CourseCounts::covered_s
    int poses = 0, lost_poses = 0, landmarks = 0;
    double path_length = 0;  ///< [m] if has_scale
    bool has_scale = true;
    std::string estimator_says;       ///< how the estimate went, in words
    std::vector<Finding> warnings;    ///< see RunRequest::warn
    std::vector<StatusEntry> events;  ///< starts, losses of track
    double input_output_s = 0, tracking_s = 0, estimation_s = 0, picture_s = 0;
    int iterations = 0;                    ///< of the batch estimator
    bool converged = false;                ///< see Estimator::converged
    std::vector<RefinedRig::Unknown> rig;  ///< parts that were estimated too
    std::string picture_problem;           ///< why there is no picture; empty: there is one
    std::string damage;  ///< why reading stopped early; empty: the whole file was read
};

/// How many times faster than the images came tracking and estimation were.
double real_time_ratio(const RunReport& report);

/// Runs the estimator over the rawlog and writes the results folder with its picture. Where the
/// rawlog is damaged midway, the results up to there are written and RunReport::damage says so.
/// Throws InputError where nothing can be estimated.
RunReport run_pipeline(const RunRequest& request);

}  // namespace vio::app
