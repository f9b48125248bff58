// Where to put the camera so that the whole path is in the picture.
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "libvio/geometry/pose.h"

namespace vio {

/// The points that a picture should hold beside the path: those inside the path's bounding box
/// grown by its diagonal's `reach`, less the outermost 2 % along each axis, so that a few far
/// outliers do not shrink the rest.
std::vector<Eigen::Vector3d> nearby_points(const std::vector<Eigen::Vector3d>& path,
                                           const std::vector<Eigen::Vector3d>& landmarks,
                                           double reach = 0.5);

/// A pinhole camera in the world.
struct CameraPlacement {
    Pose T_W_C;                    ///< z forward, x right, y down
    double focal_px = 0;           ///< [px]; image centre in the middle of the picture
    double near_m = 0, far_m = 0;  ///< depths that hold every point, with room to spare [m]
};

/// Rotation of a camera that looks along `forward` with the world's z axis upwards in the picture
/// (x to the right when it looks straight down or up).
Eigen::Matrix3d look_along(const Eigen::Vector3d& forward);

/// The closest camera with this rotation that sees all points inside the picture, less a margin
/// (share of each side). half_view_rad: half the field of view along the longer side.
CameraPlacement frame_points(const std::vector<Eigen::Vector3d>& points,
                             const Eigen::Matrix3d& R_W_C, int width, int height,
                             double half_view_rad, double margin = 0.06);

/// A camera that sees the whole path and as much of its surroundings as fits without standing more
/// than half as far again away as the path alone asks for.
CameraPlacement frame_path(const std::vector<Eigen::Vector3d>& path,
                           const std::vector<Eigen::Vector3d>& surroundings,
                           const Eigen::Matrix3d& R_W_C, int width, int height,
                           double half_view_rad);

}  // namespace vio
