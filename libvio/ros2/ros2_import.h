// Import of ROS 2 bags.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "libvio/io/measurement_source.h"

namespace vio {

/// Which topics of a bag are imported. An empty name stands for the only topic of its type, if
/// there is one.
struct Ros2ImportOptions {
    std::string image_topic;  ///< sensor_msgs/msg/Image or CompressedImage
    std::string imu_topic;    ///< sensor_msgs/msg/Imu, or the gyro's where accel_topic is given
    std::string accel_topic;  ///< sensor_msgs/msg/Imu; empty: the IMU's own
    std::string gps_topic;    ///< sensor_msgs/msg/NavSatFix
    /// PoseStamped, PoseWithCovarianceStamped, TransformStamped or Odometry; empty: no truth.
    std::string truth_topic;
    std::vector<std::string> calibration_files;  ///< over the bag's own; see load_calibrations
    bool external_images = false;                ///< PNG files beside the rawlog, else embedded
    int bit_depth = 0;                           ///< of images of 16 bits: see BitDepth
};

/// Converts a ROS 2 bag (folder, .db3 or .mcap) to a rawlog with the labels cam0 and imu0. Stamps
/// are those of the messages' headers. B is the IMU. The camera's intrinsics are those of the
/// CameraInfo beside its topic, its place on the IMU that of /tf_static between the frames that the
/// two topics' headers name, where the bag has them. Poses of the truth go to X.truth.tum as they
/// are. Messages without a stamp, with one that is not later than that of the message before, or
/// that cannot be read, are left out and counted.
/// Throws InputError for what is no bag, for topics that are missing, of another type or not named
/// where there are several; no rawlog is left then.
ImportReport import_ros2(const std::string& bag, const std::string& out_rawlog,
                         const Ros2ImportOptions& options = {},
                         const std::function<void(double)>& progress = {});

}  // namespace vio
