// The paper's error metrics (section 6.4) of several runs.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/cells.h"

namespace vio::app {

/// Means over the runs that succeeded.
struct Measures {
    int runs = 0, failed = 0;
    double rotation_mean = 0, rotation_max = 0;                     ///< [rad]
    double position_mean = 0, position_rmse = 0, position_max = 0;  ///< [m]
    std::optional<double> scale, scale_size;  ///< scale error [-], and its absolute value
    double iterations = 0, completion = 0, seconds = 0, path = 0;
    std::string message;  ///< of the first that failed

    bool any() const { return runs > failed; }
};

/// Of the comparison with the idx-th reference.
Measures measure(const std::vector<Outcome>& outcomes, size_t idx = 0);

/// A number with digits after the point.
std::string fixed(double value, int digits);

}  // namespace vio::app
