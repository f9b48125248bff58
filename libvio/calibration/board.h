// Calibration targets: points in known places, with or without a pattern that images show.
#pragma once

#include <map>
#include <vector>

#include "libvio/batch/batch.h"

namespace vio {

/// A target in its own frame: x along its rows, y along its columns, z = 0 [m].
struct Board {
    enum class Pattern { kNone, kCheckerboard, kAprilGrid };
    Pattern pattern = Pattern::kNone;
    int cols = 0, rows = 0;  ///< inner corners of a checkerboard, tags of an AprilGrid
    /// By corner's id: row by row from 0 on, x along rows, y along columns, z = 0 [m]. An AprilGrid
    /// has four corners a tag, two rows and two columns of them, tag 0 at the origin.
    std::map<FeatureId, Fiducial> points;

    /// Whether it can be told which way up the pattern is: an AprilGrid; a checkerboard with an odd
    /// and an even number of corners.
    bool has_top() const;
};

Board make_checkerboard(int cols, int rows, double col_spacing, double row_spacing);
/// tag_size: edge of a tag's black border [m]; spacing: gap between tags as a share of it.
Board make_april_grid(int cols, int rows, double tag_size, double spacing);

/// A start for the estimator: the points where they are known to be.
std::vector<LandmarkEstimate> landmarks_of(const std::map<FeatureId, Fiducial>& points);

}  // namespace vio
