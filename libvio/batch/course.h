// The course of an estimate: a first one of everything, grown or blind, then the minimum over
// everything, with what is set right in between.
#pragma once

#include <optional>

#include "libvio/batch/minimize.h"
#include "libvio/batch/model.h"

namespace vio::batch {

/// A model of the first images, its state, and what happened to it.
struct Course {
    const BatchProblem& problem;
    const BatchOptions& options;
    Model model{};
    State state{};
    bool start_confirmed = true;         ///< or else other starts led elsewhere
    std::optional<RigRefinement> rig{};  ///< while it is estimated too
    MinimizeReport last{};
    BatchReport sums{};  ///< iterations and times so far
};

/// Whether gravity was found (a blind start knows none).
bool gravity_known(const Course& course);

/// Puts gravity's norm where it belongs; the minimisation that follows settles the rest.
void fix_gravity_norm(Course& course);

/// From nothing, the first `images` at once. With readings: the paper's start, and where that ends
/// with more cost than noise explains, a second one that lets the cameras turn as the gyro says;
/// the better of the two. Images alone: grown from two views, or else the paper's start.
void start_blind(Course& course, int images);

/// Grows the estimate from a blind start of a prefix to all images, by a quarter at a time.
void start_staged(Course& course);

/// The minimum over everything, without outliers; over what the options leave open of the rig, too.
void minimize_all(Course& course);

}  // namespace vio::batch
