// Where the minimisation starts from.
#pragma once

#include <optional>
#include <vector>

#include "libvio/batch/model.h"

namespace vio::batch {

/// The paper's "blind" start (section 4.6): all cameras at the origin, points backprojected to a
/// fixed distance from the origin by their first image, everything else zero.
State blind_start(const Model& model, const BatchOptions& options);

/// The same, but the cameras turn as the gyro says. Needs inertial readings.
State turning_start(const Model& model, const BatchOptions& options);

/// Start from given states (within 1 ms of an image) and, where present, landmarks; with fiducials,
/// moved to where these are as its poses see them. Images without a state follow from their
/// neighbours' by the inertial readings, other points are triangulated. Throws InputError if no
/// image has a state.
State given_start(const Model& model, const Estimate& start);

/// Continues a state of the model's first frames to all of them, by the inertial readings (or at
/// constant velocity without them), keeping the points in `known` and triangulating the others.
State continued_start(const Model& model, const Model& shorter, const State& known);

/// Point from its active observations and the frames' poses; nothing where the parallax is too
/// small or the point comes to lie behind a camera.
std::optional<Eigen::Vector3d> triangulate_point(const Model& model, const State& state,
                                                 const Point& point);

/// Places the points that are not yet: triangulated, or else backprojected to the others' median
/// distance.
void place_other_points(const Model& model, std::vector<bool> placed, State& state);

/// Points that lie many times farther from the first camera that sees them than points do in the
/// middle, and that at least three images see (by index; fiducials never).
std::vector<int> points_at_infinity(const Model& model, const State& state);

/// Points that stand in a camera that sees them, as good as: a thousand times nearer to it than to
/// another that sees them (by index; fiducials never).
std::vector<int> points_at_cameras(const Model& model, const State& state);

/// Points that came out at less than half of the distance in the middle, from cameras so close
/// together that noise can bring one of the middle distance there (by index; fiducials never).
std::vector<int> points_near_by_noise(const Model& model, const State& state);

}  // namespace vio::batch
