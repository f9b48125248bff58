// Messages of ROS 2 as this library's measurements.
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "libvio/camera/camera.h"
#include "libvio/io/recording.h"
#include "libvio/ros2/cdr.h"

namespace vio {

/// std_msgs/msg/Header, with which all messages here begin.
struct Ros2Header {
    TimeNs t = 0;
    std::string frame;
};
/// Throws UnusableMeasurement for a stamp that was never set (zero) or is no time.
Ros2Header read_header(Cdr& cdr);

/// What follows the header of a message. All throw UnusableMeasurement for values that are not
/// finite and for a message that is cut off.
///
/// sensor_msgs/msg/Imu: angular velocity [rad/s] and acceleration [m/s^2]; its orientation and its
/// covariances are not read.
ImuReading read_imu(Cdr& cdr, TimeNs t);

/// sensor_msgs/msg/Image as grey of the 8 or 16 bits that it has: mono, rgb, bgr (with alpha),
/// Bayer patterns, YUV 4:2:2. Also throws for other encodings.
cv::Mat read_image(Cdr& cdr);
/// sensor_msgs/msg/CompressedImage likewise; also throws where it cannot be decoded.
cv::Mat read_compressed_image(Cdr& cdr);

/// sensor_msgs/msg/CameraInfo: of the raw image (K, D) or of the rectified one (P). Null for a
/// camera that was not calibrated. Throws InputError for a model of distortion that is not known
/// and for binned images and regions of interest, whose intrinsics it states otherwise.
CameraPtr read_camera_info(Cdr& cdr, bool rectified);

/// sensor_msgs/msg/NavSatFix.
GpsMessage read_fix(Cdr& cdr, TimeNs t);

/// geometry_msgs/msg/PoseStamped and PoseWithCovarianceStamped; with the name of a child frame
/// before it, TransformStamped and nav_msgs/msg/Odometry.
Pose read_pose(Cdr& cdr, bool child_is_named);

/// tf2_msgs/msg/TFMessage: T_parent_child of each.
struct Ros2Transform {
    std::string parent, child;
    Pose T_parent_child;
};
std::vector<Ros2Transform> read_transforms(Cdr& cdr);

}  // namespace vio
