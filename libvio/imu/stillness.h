// Whether an IMU was at rest, by the spread of its readings against its noise.
#pragma once

#include <span>
#include <string>

#include "libvio/base/types.h"
#include "libvio/imu/noise.h"

namespace vio {

/// What a stretch of rest says.
struct Stillness {
    TimeNs from = 0, to = 0;                          ///< on the IMU's clock
    Eigen::Vector3d gyro = Eigen::Vector3d::Zero();   ///< mean reading [rad/s]
    Eigen::Vector3d accel = Eigen::Vector3d::Zero();  ///< mean reading [m/s^2]
    double seconds() const { return to_seconds(to - from); }
};

/// Why a stretch is not one of rest: the measured value against its limit; empty if it is.
/// At rest the readings' squared deviations from their mean obey chi-square laws of the IMU's white
/// noise, as do those of the means of each quarter and of the last tenth of a second: the first
/// tells shaking, the others slow motion and motion that has just begun. Steady motion and steady
/// turns cannot be told from rest.
/// readings: of the stretch from stretch.from to stretch.to, in order of time, both ends covered
/// and without a hole; where they are, their means are written into the stretch.
std::string why_not_still(std::span<const ImuReading> readings, const ImuNoise& noise,
                          Stillness& stretch);

}  // namespace vio
