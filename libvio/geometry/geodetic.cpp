#include "libvio/geometry/geodetic.h"

#include <cmath>

#include "libvio/base/angles.h"

namespace vio {
namespace {

constexpr double kA = 6378137, kF = 1 / 298.257223563;  // WGS84
constexpr double kE2 = kF * (2 - kF);

Eigen::Vector3d ecef(const Geodetic& place) {
    const double phi = place.latitude_deg * kDegree, lambda = place.longitude_deg * kDegree;
    const double n = kA / std::sqrt(1 - kE2 * std::sin(phi) * std::sin(phi));
    const double r = (n + place.altitude_m) * std::cos(phi);
    return {r * std::cos(lambda), r * std::sin(lambda),
            (n * (1 - kE2) + place.altitude_m) * std::sin(phi)};
}

// Rows: east, north, up in earth-centred axes.
Eigen::Matrix3d enu_axes(const Geodetic& origin) {
    const double phi = origin.latitude_deg * kDegree, lambda = origin.longitude_deg * kDegree;
    const double sp = std::sin(phi), cp = std::cos(phi), sl = std::sin(lambda),
                 cl = std::cos(lambda);
    Eigen::Matrix3d axes;
    axes << -sl, cl, 0, -sp * cl, -sp * sl, cp, cp * cl, cp * sl, sp;
    return axes;
}

}  // namespace

Eigen::Vector3d enu_from_geodetic(const Geodetic& place, const Geodetic& origin) {
    return enu_axes(origin) * (ecef(place) - ecef(origin));
}

Geodetic geodetic_from_enu(const Eigen::Vector3d& enu_m, const Geodetic& origin) {
    const Eigen::Vector3d p = ecef(origin) + enu_axes(origin).transpose() * enu_m;
    const double r = std::hypot(p.x(), p.y());
    // Fixed-point iteration on the latitude; it gains a factor of 1 / e^2 = 150 per step.
    double phi = std::atan2(p.z(), r * (1 - kE2)), n = kA;
    for (int i = 0; i < 8; ++i) {
        n = kA / std::sqrt(1 - kE2 * std::sin(phi) * std::sin(phi));
        phi = std::atan2(p.z() + kE2 * n * std::sin(phi), r);
    }
    n = kA / std::sqrt(1 - kE2 * std::sin(phi) * std::sin(phi));
    // Not r / cos(phi) - n, which fails at the poles.
    const double altitude = r * std::cos(phi) + p.z() * std::sin(phi) - kA * kA / n;
    return {phi / kDegree, std::atan2(p.y(), p.x()) / kDegree, altitude};
}

}  // namespace vio
