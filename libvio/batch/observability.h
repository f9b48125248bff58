// What the measurements of a batch problem leave undetermined, in words.
#pragma once

#include <string>
#include <vector>

#include "libvio/batch/normal_equations.h"
#include "libvio/batch/objective.h"

namespace vio::batch {

/// What is not determined, and how well the scale is.
struct Observability {
    /// Relative standard deviation of the path's scale; 0 where it is not estimated (image-only,
    /// fiducials).
    double scale_sigma = 0;
    /// One entry for each quantity that is not determined to any useful accuracy; empty: all are.
    std::vector<std::string> undetermined;
};

/// Judges the solution `state`, at which `equations` are linearised and factorised (undamped).
/// A quantity counts as undetermined when its standard deviation exceeds: scale 50 %, gravity's
/// direction 10 degrees; of image-only motion an image's rotation 10 degrees or its position half
/// the path's extent; points: when most have a distance that is uncertain by half even with the
/// cameras' poses known.
Observability judge(const Model& model, const Objective& objective, const State& state,
                    const NormalEquations& equations);

/// Where the information matrix has no inverse: names the unknowns with the least information, from
/// the vector that the damped matrix changes least (inverse iteration).
std::string name_null_space(const Model& model, NormalEquations& equations);

}  // namespace vio::batch
