// A start from images alone: two views first, then outwards image by image.
#pragma once

#include <optional>

#include "libvio/batch/model.h"

namespace vio::batch {

/// A start, and whether growing from other images led to the same cost (or there are none to try).
struct Grown {
    State state;
    bool confirmed = true;
};

/// Structure from motion without inertial readings. The two images that tell the most points'
/// distances place each other by their epipolar geometry; the images between and around them are
/// placed one by one by the points that are known already, points by the images that are placed,
/// and a quarter more images at a time settle with their points. Images alone have many minima, and
/// outliers lead to more: further pairs of images are tried until two have led to the same cost;
/// of all, the best is kept. The first image's body is the frame, points lie around
/// options.blind_distance from the cameras. Nothing where no two images share enough points, or
/// none with parallax.
std::optional<Grown> grow_from_two_views(const Model& model, const BatchOptions& options);

}  // namespace vio::batch
