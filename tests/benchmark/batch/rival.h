// The batch problem handed to Ceres: the same residuals and derivatives, its general solver.
#pragma once

#include <array>
#include <limits>

#include "libvio/batch/model.h"

namespace vio::bench {

struct Solved {
    int iterations = 0;         ///< steps tried
    double seconds = 0;         ///< from the model to the solution
    double final_cost = 0;      ///< sum of squared distances
    double linear_seconds = 0;  ///< of these, forming and solving the linear systems
    bool converged = false;
    // Seconds and cost after each step, the first ones; unused: infinite cost.
    static constexpr int kSteps = 256;
    std::array<double, kSteps> step_seconds{}, step_cost{};

    Solved() { step_cost.fill(std::numeric_limits<double>::infinity()); }
    /// Seconds until the cost was this or less.
    double seconds_to(double cost) const {
        for (int k = 0; k < kSteps; ++k)
            if (step_cost[k] <= cost) return step_seconds[k];
        return seconds;
    }
};

/// SPARSE_SCHUR, points first, tolerances 1e-9.
Solved solve_with_ceres(const batch::Model& model, const BatchOptions& options,
                        const batch::State& start, int threads);

}  // namespace vio::bench
