// The batch estimator with parts of the rig among its unknowns.
#pragma once

#include <string>
#include <vector>

#include "libvio/batch/batch.h"
#include "libvio/imu/preintegration.h"

namespace vio {

/// What of the rig is to be found.
struct RigQuestion {
    bool extrinsics = false;   ///< T_I_C
    bool time_offset = false;  ///< of the camera's clock
    /// How many intrinsics: 4 (fx fy cx cy) and the first distortion coefficients; 0: none.
    int intrinsics = 0;
};

/// A rig as estimated, with the uncertainty of its unknown parts and how well it fits.
struct RigCalibration {
    Rig rig;
    /// Of what was asked for, in this order: T_I_C (rotation [rad], position [m] in the pose's
    /// tangent order), time offset [s], intrinsics.
    Eigen::MatrixXd covariance;
    std::vector<std::string> names;  ///< of these unknowns
    bool converged = false;
    std::string reason;
    int iterations = 0;
    int images = 0, observations = 0, outliers = 0;
    double sigma_px = 0;  ///< that the covariance is based on, one coordinate
    double rms_px = 0;    ///< of the observations that are no outliers, one coordinate
    ImuBias bias;         ///< mean over the images
    Eigen::Vector3d g_W = Eigen::Vector3d::Zero();
    std::vector<TimedPose> T_W_C;  ///< camera at each image
    /// Of all observations, outliers too: where, and seen less predicted.
    struct Residual {
        int image_idx = 0;
        FeatureId id = -1;
        Eigen::Vector2d uv_px, error_px;
        bool outlier = false;
    };
    std::vector<Residual> residuals;
};

/// Minimises the batch estimator's error over motion, points and the rig at once, by
/// Levenberg-Marquardt from `start`, which must hold a state of at least one image, and
/// problem.rig. options.sigma_px = 0: from the residuals. Throws InputError as estimate_batch()
/// does, and where the measurements leave an unknown of the rig undetermined.
RigCalibration calibrate_rig(const BatchProblem& problem, const BatchOptions& options,
                             const RigQuestion& question, const Estimate& start);

}  // namespace vio
