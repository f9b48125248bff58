// Levenberg-Marquardt.
#pragma once

#include <string>

#include "libvio/batch/objective.h"

namespace vio::batch {

struct MinimizeLimits {
    int max_iterations = 200;
    double cost_tolerance = 1e-8;   ///< relative decrease below which it has converged
    double initial_damping = 1e-6;  ///< near the solution; 1e-3 where nothing is known
};

struct MinimizeReport {
    bool converged = false;
    std::string reason;
    int iterations = 0;   ///< steps tried
    int rejected = 0;     ///< of these, steps that would have raised the cost
    double gradient = 0;  ///< at the end: decrease that a full step promises, relative to the cost
    Cost initial, final;
    double linearize_s = 0, solve_s = 0, evaluate_s = 0;
};

/// Minimises the objective from `state` on, which is left at the best state found, and at which
/// `equations` are left linearised.
/// Damping after Marquardt (scaled by the Hessian's diagonal), raised and lowered after Nielsen
/// (1999).
MinimizeReport minimize(Objective& objective, NormalEquations& equations,
                        const MinimizeLimits& limits, State& state);

}  // namespace vio::batch
