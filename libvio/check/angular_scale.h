// Whether the angles between a camera's rays are right, by its images alone.
//
// Two images of a rigid scene agree on one motion only if the angles between their rays are right.
// The angle theta of each ray from the optical axis is therefore replaced by s theta, and s sought
// together with the motions of all pairs of images so that the least of the epipolar errors is
// left. These are taken in the rays as stated (an error of a ray grows with s: taken in the scaled
// rays they would vanish with s). Sharp for wide cameras alone: through a narrow lens turns and
// shifts absorb the scale.
#pragma once

#include <optional>
#include <vector>

#include "libvio/check/finding.h"
#include "libvio/tracking/two_view.h"

namespace vio {

/// True angle of a ray from the optical axis over the stated one, with 1-sigma.
struct AngularScale {
    double scale = 1, sigma = 0;
    int pairs = 0;  ///< of images
};

/// Features that two images have in common, by rays as stated, and the camera's motion between.
struct RayViews {
    std::vector<RayPair> pairs;
    TwoViewMotion motion;
};

/// axis: +1 if the camera looks along its z, -1 along -z (by way of a mirror). finest: least error
/// of a ray [rad]. Nothing if there are fewer than 15 pairs of images, or no minimum near 1.
std::optional<AngularScale> fit_angular_scale(std::vector<RayViews> views, double axis,
                                              double finest);

/// Verdict on it.
Finding check_angles(const std::optional<AngularScale>& angles);

}  // namespace vio
