// An accelerometer that is a stream of its own, at the times of another sensor.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>

#include "libvio/base/types.h"

namespace vio {

/// What a gyro's readings are that find no acceleration, in lists of what is left out.
inline constexpr const char* kGyroAlone = "gyro readings with no accelerometer beside";

/// Interpolates linearly between readings that are no more than 0.1 s apart.
class AccelerometerStream {
 public:
    struct Reading {
        TimeNs t = 0;
        Eigen::Vector3d accel = Eigen::Vector3d::Zero();  ///< [m/s^2]
    };
    /// `next` gives the readings in order of time, nothing after the last one.
    explicit AccelerometerStream(std::function<std::optional<Reading>()> next);

    /// Acceleration at a time, not before that of the last call; nothing outside the readings or
    /// in a gap between them.
    std::optional<Eigen::Vector3d> at(TimeNs t);

 private:
    std::function<std::optional<Reading>()> next_;
    std::optional<Reading> before_, after_;
};

}  // namespace vio
