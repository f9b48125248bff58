// Angles are in rad everywhere inside; people read and write degrees.
#pragma once

#include <numbers>

namespace vio {

inline constexpr double kDegree = std::numbers::pi / 180;  ///< [rad]

}  // namespace vio
