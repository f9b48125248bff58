// WGS84 positions and a local Cartesian frame east, north, up.
#pragma once

#include <Eigen/Dense>

namespace vio {

/// Place on or above the WGS84 ellipsoid.
struct Geodetic {
    double latitude_deg = 0, longitude_deg = 0;
    double altitude_m = 0;  ///< above the ellipsoid
};

/// East, north, up [m] of a place, in the frame whose origin is `origin`; exact.
Eigen::Vector3d enu_from_geodetic(const Geodetic& place, const Geodetic& origin);

/// Inverse of enu_from_geodetic to better than 1e-6 m within 100 km.
Geodetic geodetic_from_enu(const Eigen::Vector3d& enu_m, const Geodetic& origin);

}  // namespace vio
