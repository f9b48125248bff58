// Angles are in rad everywhere inside; people read and write degrees.
#pragma once

#include <numbers>

namespace vio {

inline constexpr double kDegree = std::numbers::pi / 180;  ///< [rad]
/// Standard deviation of an angle of which nothing is known [rad].
inline constexpr double kAnyAngle = std::numbers::pi * std::numbers::inv_sqrt3;

}  // namespace vio
