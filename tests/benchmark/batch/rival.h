// The batch problem handed to Ceres: the same residuals and derivatives, its general solver.
#pragma once

#include "libvio/batch/model.h"

namespace vio::bench {

struct Solved {
    int iterations = 0;         ///< steps tried
    double seconds = 0;         ///< from the model to the solution
    double final_cost = 0;      ///< sum of squared distances
    double linear_seconds = 0;  ///< of these, forming and solving the linear systems
    bool converged = false;
};

/// SPARSE_SCHUR, points first, tolerances 1e-9.
Solved solve_with_ceres(const batch::Model& model, const BatchOptions& options,
                        const batch::State& start, int threads);

}  // namespace vio::bench
