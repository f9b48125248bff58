// From the solver's unknowns to the estimate: world frame with z up, body states, covariances.
#pragma once

#include "libvio/batch/normal_equations.h"
#include "libvio/batch/objective.h"

namespace vio::batch {

/// Estimate in the published frames. With covariances where `equations` are given, linearised and
/// factorised (undamped) at `state`: they are those of the inverse information, what was widened
/// included, the first pose and (with inertial data) the heading about the vertical being the
/// gauge, i.e. known exactly. Where gravity's norm is known, the accelerometer bias's covariance
/// has the curvature of its trade with gravity's direction added. Motions are given between
/// consecutive ones of the frames `keyframes` (indices).
Estimate publish(const Model& model, const Objective& objective, const State& state,
                 const std::vector<int>& keyframes, const NormalEquations* equations);

/// Last state and the points that its image sees, with joint covariance.
BatchTail publish_tail(const Model& model, const Objective& objective, const State& state,
                       const NormalEquations& equations);

}  // namespace vio::batch
