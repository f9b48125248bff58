// Where a mirror sits before its camera, from images of targets whose places are known.
#pragma once

#include <map>
#include <optional>
#include <vector>

#include "libvio/batch/batch.h"
#include "libvio/camera/mirror.h"

namespace vio {

/// What is known beforehand, and when to stop.
struct MirrorCalibrationOptions {
    double sigma_px = 0;  ///< of a target's image, one coordinate; 0: from the residuals
    /// Camera in the targets' frame G, held as given, for a single image. Nothing: found too.
    std::optional<Pose> T_G_C;
    double outlier_sigmas = 5;  ///< targets beyond are dropped after convergence; 0: none
    int max_iterations = 100;
};

/// The mirror's place in the camera frame C, and how well the targets fit.
struct MirrorCalibration {
    Pose T_C_M;
    /// Of T_C_M in the tangent order (rotation, translation). The rotation about the mirror's axis,
    /// which nothing shows, stays as it was: zero row and column.
    Matrix6d covariance = Matrix6d::Zero();
    /// Of each image that was used.
    struct View {
        size_t frame_idx;
        Pose T_G_C;
    };
    std::vector<View> views;
    /// Of a target in an image [px].
    struct Residual {
        FeatureId id;
        Eigen::Vector2d uv_px, error_px;  ///< where, and seen less predicted
    };
    std::vector<Residual> residuals;  ///< of the targets that were used, image by image
    int outliers = 0;
    double rms_px = 0;    ///< per coordinate
    double sigma_px = 0;  ///< that the covariance is based on
    int iterations = 0;
};

/// Least squares over T_C_M and the camera's pose in each image, by Levenberg and Marquardt from
/// the nominal T_C_M. targets: in their frame G, by the features' ids. Images of which
/// board_pose() finds no pose are left out. Source: Strelow, Mishler, Singh and Herman (2001), as
/// Strelow and Singh (2004), section 4.5, describe it, for any number of images. Throws InputError
/// where the targets do not determine the unknowns, or the search does not converge.
MirrorCalibration calibrate_mirror(const MirrorCamera& nominal,
                                   const std::vector<FeatureFrame>& frames,
                                   const std::map<FeatureId, Fiducial>& targets,
                                   const MirrorCalibrationOptions& options = {});

}  // namespace vio
