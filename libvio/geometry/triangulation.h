// Point from rays.
#pragma once

#include <Eigen/Dense>
#include <optional>
#include <vector>

namespace vio {

/// A sight line in the world frame.
struct SightLine {
    Eigen::Vector3d origin;     ///< [m]
    Eigen::Vector3d direction;  ///< unit vector
};

/// A point in the world frame, and how well its sight lines tell it.
struct Triangulation {
    Eigen::Vector3d point;       ///< [m]
    Eigen::Matrix3d covariance;  ///< for the given angular standard deviation [m^2]
    double parallax;             ///< largest angle between the first sight line and another [rad]
};

/// Point that minimises the squared angular distance to all sight lines (linear start, then
/// Gauss-Newton). sigma is the angular standard deviation of a sight line [rad].
/// Nothing if fewer than two lines, all parallel, or the point comes to lie behind an origin.
std::optional<Triangulation> triangulate(const std::vector<SightLine>& lines, double sigma);

}  // namespace vio
