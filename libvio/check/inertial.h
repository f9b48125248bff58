// Whether the readings of an IMU can be what it says: units, gravity, axes, range.
#pragma once

#include <vector>

#include "libvio/base/types.h"
#include "libvio/check/finding.h"
#include "libvio/imu/noise.h"

namespace vio {

/// Means of the readings over short spans, which quiet their noise.
struct ReadingMean {
    double t = 0;  ///< middle of the span, from the first reading [s]
    Eigen::Vector3d gyro = Eigen::Vector3d::Zero(), accel = Eigen::Vector3d::Zero();
};

/// Spans of `span` seconds that hold readings throughout. readings: in order of time.
std::vector<ReadingMean> reading_means(const std::vector<ImuReading>& readings, double span);

/// What the seconds say in which the readings are those of an IMU that is still (why_not_still):
/// rest, or even motion. The unit of the accelerometer does not matter.
struct Rest {
    double seconds = 0;  ///< in all; 0: none was found, and the rest is not meaningful
    double gravity = 0;  ///< median length of the mean specific force, as recorded
    Eigen::Vector3d gyro = Eigen::Vector3d::Zero();  ///< mean, as recorded
};
/// readings: in order of time.
Rest find_rest(const std::vector<ImuReading>& readings, const ImuNoise& noise);

/// Whether the direction of the specific force turns as the gyro says. Over stretches of some
/// seconds each mean is turned back into the frame of the stretch's beginning, where gravity, most
/// of it, stays put: `spread` is what is left of its changes, as a share of its square. The same is
/// tried with the accelerometer's axes exchanged and negated. Neither a common sign of all axes nor
/// axes in which nothing turns can be told.
struct GravityTurn {
    double tilt = 0;    ///< rms change of the recorded direction within a stretch [rad]
    double spread = 0;  ///< with the axes as recorded
    double best_spread = 0;
    Eigen::Matrix3d best_axes = Eigen::Matrix3d::Identity();  ///< true = best_axes measured
    double best_unit = 1;  ///< of the gyro [rad/s]: 1 or pi / 180
};
GravityTurn gravity_turn(const std::vector<ReadingMean>& means);

/// Verdicts on the readings' values. readings: in order of time, no stamp twice.
std::vector<Finding> check_readings(const std::vector<ImuReading>& readings, const ImuNoise& noise);

}  // namespace vio
