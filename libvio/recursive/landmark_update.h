// Update with the landmarks of the state that an image shows, Eq. (22).
#pragma once

#include <vector>

#include "libvio/recursive/filter_state.h"
#include "libvio/recursive/observation.h"
#include "libvio/tracking/predicted_feature.h"

namespace vio {

/// Which landmark of the state was seen, and where.
struct LandmarkSight {
    int landmark_idx = -1;
    Sight sight;
};

// Sights are of an image of which there is a clone, in the given slot.

/// Sights whose innovation's squared Mahalanobis distance is below the gate at the present mean.
std::vector<LandmarkSight> gated_sights(const FilterState& state,
                                        const std::vector<LandmarkSight>& sights, int slot,
                                        const Camera& camera, double gate);

/// Sights that agree with one another, whether or not with the clone's pose, which may be off by
/// the standard deviations [rad], [m] beyond its own uncertainty: those within the gate of the mean
/// that all together ask for, with weights after Cauchy's loss.
std::vector<LandmarkSight> agreeing_sights(const FilterState& state,
                                           const std::vector<LandmarkSight>& sights, int slot,
                                           const Camera& camera, double gate, double rotation,
                                           double position);

/// Where the camera sees the landmarks from a clone; those that it does not see are left out.
std::vector<PredictedFeature> predicted_features(const FilterState& state, int slot,
                                                 const Camera& camera);

/// Iterated update with all sights jointly.
void update_landmarks(FilterState& state, const std::vector<LandmarkSight>& sights, int slot,
                      const Camera& camera, int max_iterations);

}  // namespace vio
