// Levenberg-Marquardt.
#pragma once

#include <string>

#include "libvio/batch/objective.h"

namespace vio::batch {

struct MinimizeLimits {
    int max_iterations = 200;
    double cost_tolerance = 1e-8;  ///< relative decrease below which it has converged
};

struct MinimizeReport {
    bool converged = false;
    std::string reason;
    int iterations = 0;
    Cost initial, final;
};

/// Minimises the objective from `state` on, which is left at the best state found.
/// Damping after Marquardt (scaled by the Hessian's diagonal), updated after Nielsen (1999).
MinimizeReport minimize(Objective& objective, NormalEquations& equations,
                        const MinimizeLimits& limits, State& state);

}  // namespace vio::batch
