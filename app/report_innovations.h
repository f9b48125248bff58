// What the recursive estimator's images told it beyond what its state expected.
#pragma once

#include <string>
#include <vector>

#include "app/page.h"
#include "app/plot.h"
#include "libvio/base/estimate.h"

namespace vio::app {

/// Innovations over time, normalised by the covariance that the state claims and in pixels.
/// Nothing without innovations (batch estimator).
std::vector<Plot> innovation_plots(const Estimate& estimate);

/// How many points the gate refused, over time; empty without innovations.
Series refused_points(const Estimate& estimate);

/// The same in numbers; without rows if there are none.
Table innovation_table(const Estimate& estimate);

/// One line where innovations are larger than the covariance that the filter claims, or many points
/// were refused; else nothing.
std::string innovation_warning(const Estimate& estimate);

}  // namespace vio::app
