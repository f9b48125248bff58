// The camera's pose from one image of points whose places are known.
#pragma once

#include <map>
#include <optional>

#include "libvio/batch/batch.h"

namespace vio {

/// Camera in the board's frame W, and how well the corners fit.
struct BoardPose {
    Pose T_W_C;
    int points = 0;
    double rms_px = 0;  ///< per coordinate
};

/// By OpenCV's perspective-n-point on the sight lines that are less than 80 degrees from their mean
/// direction, as if through one viewpoint; then refined in the image, for any camera. Nothing with
/// fewer than six such points, or where no pose is found.
std::optional<BoardPose> board_pose(const Camera& camera, const FeatureFrame& frame,
                                    const std::map<FeatureId, Fiducial>& board);

}  // namespace vio
