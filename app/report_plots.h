// Plots of a report.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "app/comparison.h"
#include "app/plot.h"
#include "libvio/base/estimate.h"

namespace vio::app {

/// A result with what it is compared with.
struct Material {
    std::string folder;
    Estimate estimate;
    JudgedResult judged;
    nlohmann::json summary;
    std::vector<Reference> references;
    std::vector<Evaluation> evaluations;

    TimeNs start() const { return estimate.states.front().t; }
    double seconds(TimeNs t) const { return to_seconds(t - start()); }
};

/// From above and from the side, the references aligned to the estimate.
std::vector<Plot> path_plots(const Material& m);

/// Size of the aligned errors, against every reference.
std::vector<Plot> error_size_plots(const Material& m);

/// Errors of position (world axes) and rotation (body axes) against the first reference with their
/// 3-sigma bands; nothing if it has no attitude or the result no covariance. The worlds are brought
/// together at the first pose, as for the NEES: there the covariance is expressed.
std::vector<Plot> error_plots(const Material& m);

/// Velocity and biases with their 3-sigma bands; nothing for a result without scale.
std::vector<Plot> state_plots(const Material& m);

/// Points used and refused.
Plot feature_plot(const Material& m);

}  // namespace vio::app
