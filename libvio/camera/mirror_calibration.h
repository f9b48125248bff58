// Where a mirror sits before its camera, from one image of targets whose places are known.
#pragma once

#include <optional>
#include <vector>

#include "libvio/camera/mirror.h"

namespace vio {

/// A target: its place in the targets' frame G [m], and its image.
struct CalibrationTarget {
    Eigen::Vector3d p_G;
    Eigen::Vector2d uv_px;
};

struct MirrorCalibrationOptions {
    double sigma_px = 0;  ///< of a target's image; 0: from the residuals
    /// Camera in the targets' frame, held as given. Nothing: estimated too, from a start that needs
    /// at least six targets that are not in one plane.
    std::optional<Pose> T_G_C;
    int max_iterations = 100;
};

struct MirrorCalibration {
    Pose T_C_M;
    /// Of T_C_M in the tangent order (rotation, translation). The rotation about the mirror's axis,
    /// which nothing shows, stays as it was: zero row and column.
    Matrix6d covariance = Matrix6d::Zero();
    Pose T_G_C;
    std::vector<Eigen::Vector2d> residuals_px;  ///< seen less predicted, in order of the targets
    double rms_px = 0;                          ///< per coordinate
    double sigma_px = 0;                        ///< that the covariance is based on
    int iterations = 0;
};

/// Least squares over T_C_M, and T_G_C unless given, by Levenberg and Marquardt from the camera's
/// T_C_M. Source: Strelow, Mishler, Singh and Herman (2001), as Strelow and Singh (2004), section
/// 4.5, describe it. Throws InputError where the targets do not determine the unknowns, or the
/// search does not converge.
MirrorCalibration calibrate_mirror(const MirrorCamera& nominal,
                                   const std::vector<CalibrationTarget>& targets,
                                   const MirrorCalibrationOptions& options = {});

}  // namespace vio
