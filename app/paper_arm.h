// The perspective arm experiment (section 7): what its tables share.
#pragma once

#include <string>
#include <vector>

#include "app/paper_rows.h"

namespace vio::app {

/// Factors by which recordings are slowed (Tables 2 and 7).
constexpr int kFactors[] = {1, 2, 4, 8};

/// `run` on the arm's recording of a seed.
Cell arm(const PaperSetup& setup, int seed, const std::string& run);

/// A recording slowed by the procedure of section 7.3.2, which divides gravity by the factor
/// squared.
Cell slowed(Cell cell, int factor, int seed);

Measures measured(const CellStore& store, const std::vector<Cell>& cells);

/// With the weights of the propagated noise, this project's default: what the recordings allow.
std::vector<Cell> default_batch(const PaperSetup& setup, int factor = 1);
Yardstick own_weights(const PaperSetup& setup, const CellStore& store, int factor = 1);

/// What the recordings allow a filter that starts from a batch estimate of `prefix` images, for it
/// knows no later image than a pose's own: the batch estimate of these images gives their poses,
/// those of all images up to each later control point the pose there.
std::vector<Cell> growing_batches(const PaperSetup& setup, int prefix, int factor = 1);
Yardstick causal_batches(const PaperSetup& setup, const CellStore& store, int prefix,
                         int factor = 1);

/// Tables 1, 2, 4 and Fig. 8; Tables 5, 6, 7 and Fig. 10.
std::vector<Exhibit> arm_batch_exhibits();
std::vector<Exhibit> arm_filter_exhibits();

}  // namespace vio::app
