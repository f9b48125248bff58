// A rawlog as a data set in EuRoC/ASL layout, for other programs.
#pragma once

#include <functional>
#include <string>

#include "libvio/io/recording.h"

namespace vio {

/// What of a rawlog is exported.
struct AslExportOptions {
    RecordingOptions recording;  ///< which camera and IMU, and their calibration
    std::string truth_file;      ///< TUM or EuRoC; empty: NAME.truth.tum beside NAME.rawlog, if any
};

/// What was exported.
struct AslExportReport {
    int images = 0, feature_frames = 0, imu_readings = 0, truth_poses = 0;
    int left_out = 0;      ///< odometry and GPS messages, for which the layout has no place
    LeftOutList unusable;  ///< see Recording::left_out
};

/// Writes DIR/mav0 with cam0 (sensor.yaml, data.csv, data/STAMP.png as 8-bit grey, features.csv),
/// imu0 and state_groundtruth_estimate0, as far as the rawlog has them. import_asl() makes the same
/// rawlog of it again: stamps, readings, pixels and feature places to the bit, calibration to the
/// rounding of T_BS. Not kept: the shapes of feature covariances, colours. Beyond the layout's own
/// keys stand timeshift_cam_imu and gyroscope_sensitivity_error.
/// mav0 appears when it is complete. Throws InputError if it is there already, for a camera that
/// sensor.yaml cannot describe (a mirror, a limited field), and as Recording does.
AslExportReport export_asl(const std::string& rawlog_file, const std::string& dir,
                           const AslExportOptions& options = {},
                           const std::function<void(double)>& progress = {});

}  // namespace vio
