// Levenberg-Marquardt.
#pragma once

#include <string>
#include <vector>

#include "libvio/batch/objective.h"
#include "libvio/batch/rig_refinement.h"

namespace vio::batch {

/// When a minimisation ends; costs are in squared standard deviations.
struct MinimizeLimits {
    int max_iterations = 200;
    double cost_tolerance = 1e-8;   ///< relative decrease below which it has converged
    double initial_damping = 1e-8;  ///< near the solution
    /// It has also converged when undamped steps shrink so that all those to come, of which the
    /// first is foretold with the last factorisation, will not take more off the cost than this,
    /// or 1e-5 of it. The joint distance of the unknowns from the minimum, in their own standard
    /// deviations, is then its square root: far below noise.
    double negligible = 1e-2;
};

/// Why a minimisation ended and what it took; times in seconds.
struct MinimizeReport {
    bool converged = false;
    std::string reason;
    int iterations = 0;   ///< steps tried
    int rejected = 0;     ///< of these, steps that would have raised the cost
    double gradient = 0;  ///< at the end: decrease that a full step promises, relative to the cost
    Cost initial, final;
    double linearize_s = 0, solve_s = 0, evaluate_s = 0;
    /// How far it had come after each step that was taken.
    struct Progress {
        double seconds = 0;  ///< since the beginning
        double cost = 0;
    };
    std::vector<Progress> progress;
};

/// Minimises the objective from `state` on, which is left at the best state found, and at which
/// `equations` are left linearised.
/// Damping after Marquardt (scaled by the Hessian's diagonal), raised and lowered after Nielsen
/// (1999); undamped steps that lead up are shortened first. After each step points settle with the
/// poses as they are (embedded point iterations; Jeong et al. 2012). `rig`, if given, is estimated
/// too and left where it fits best.
MinimizeReport minimize(Objective& objective, NormalEquations& equations,
                        const MinimizeLimits& limits, State& state, RigRefinement* rig = nullptr);

}  // namespace vio::batch
