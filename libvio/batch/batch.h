// Batch estimator (section 4 of the paper): Levenberg-Marquardt over every pose, velocity, point,
// gravity and bias at once.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "libvio/base/estimate.h"
#include "libvio/base/options.h"
#include "libvio/camera/rig.h"
#include "libvio/imu/integration.h"

namespace vio {

/// A point whose position is known beforehand, in the frame of the survey.
struct Fiducial {
    Eigen::Vector3d p_W = Eigen::Vector3d::Zero();         ///< [m]
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< [m^2]; zero: exactly known
};

/// Everything that was observed. An empty IMU sequence makes the estimate image-only.
struct BatchProblem {
    Rig rig;
    std::vector<FeatureFrame> frames;  ///< in order of time
    ImuSequence imu;
    std::map<FeatureId, Fiducial> fiducials;  ///< if any, W is the frame of the survey
};

/// How the batch estimator weighs measurements, starts and stops.
struct BatchOptions {
    double sigma_px = 1.0;
    std::string weighting = "preintegrated";  ///< preintegrated | fixed
    double fixed_variance = 1e-5;             ///< of rotation, velocity, position when fixed
    std::string gravity = "magnitude";        ///< magnitude (fixed norm) | free
    double gravity_norm = 9.81;               ///< [m/s^2]
    std::string bias = "random_walk";         ///< random_walk | constant
    double accel_bias_sigma = 0.5;            ///< prior, Eq. (12) [m/s^2]
    double gyro_bias_sigma = 0.1;             ///< prior [rad/s]
    std::string loss = "cauchy";              ///< none | huber | cauchy
    double loss_width = 2.0;                  ///< in standard deviations
    /// auto | blind | staged | iekf. auto and iekf: given by the caller, else staged. Ignored when
    /// a start is given.
    std::string start = "auto";
    int prefix_images = 40;       ///< that a staged start begins with
    double blind_distance = 3.0;  ///< [m]
    int max_iterations = 200;
    double cost_tolerance = 1e-8;
    double outlier_sigmas = 5.0;  ///< observations beyond are dropped after convergence
    bool covariances = true;
    int threads = 0;  ///< 0: one for each processor; results do not depend on it
    // What the calibration is known to; 0: exactly. What is not is estimated with everything else.
    double intrinsics_sigma = 0;           ///< that each alone displaces a pixel by at most [px]
    double extrinsics_rotation_sigma = 0;  ///< of the camera on the IMU, about each axis [deg]
    double extrinsics_position_sigma = 0;  ///< along each axis [m]
    double time_offset_sigma = 0;          ///< of the camera's clock [s]

    void describe(OptionSet& options);
};

/// How the minimisation went.
struct BatchReport {
    bool converged = false;
    std::string reason;  ///< why it stopped, in words
    int iterations = 0, rejected_steps = 0;
    double initial_cost = 0, final_cost = 0;
    double image_cost = 0, inertial_cost = 0, prior_cost = 0;
    int observations = 0, outliers = 0;
    double gradient = 0;  ///< relative decrease of the cost that one more step promises
    /// Quantities that the measurements do not determine, in words; empty: all are determined.
    std::vector<std::string> undetermined;
    double scale_sigma = 0;  ///< relative standard deviation of the path's scale; 0: not estimated
    double seconds = 0;
    /// Of these: for the first estimate, the final minimisation, covariances; and of both
    /// minimisations: derivatives, linear systems, trial costs.
    double start_s = 0, minimize_s = 0, covariance_s = 0;
    double linearize_s = 0, solve_s = 0, evaluate_s = 0;
    /// Of the reduced system at the solution, a cheap estimate; 0: not computed, or singular.
    double reciprocal_condition = 0;
};

/// Joint estimate of the last state and the points that it sees, for the recursive estimator.
/// Error order: the last state's 15 (StateIndex), then three for each landmark in order.
struct BatchTail {
    StateEstimate state;
    std::vector<LandmarkEstimate> landmarks;
    Eigen::Vector3d g_W;
    Eigen::MatrixXd covariance;  ///< (15 + 3 n) square
    /// Covariance of these errors with those of RefinedRig; empty: the rig is as stated.
    Eigen::MatrixXd with_rig;
};

/// The rig as estimated, where BatchOptions leaves parts of it open.
struct RefinedRig {
    Rig rig;
    /// One unknown: T_I_C's rotation (in the tangent space of what is stated) and position, time
    /// offset, intrinsics.
    struct Unknown {
        std::string name, unit;
        double change = 0;        ///< from what is stated
        double sigma = 0;         ///< of the estimate; 0: not computed
        double stated_sigma = 0;  ///< of what is stated; 0: exact, it did not move
    };
    std::vector<Unknown> unknowns;
    Eigen::MatrixXd covariance;  ///< of these; empty: not computed
};

/// Estimate, how it came about, and what a filter may go on from.
struct BatchResult {
    Estimate estimate;
    BatchReport report;
    std::optional<RefinedRig> rig;
    std::optional<BatchTail> tail;  ///< if asked for
};

/// Runs the estimator. Image-only, images that see hardly any points get no state. `start`, if
/// given, holds states of frames (by time); those of others follow by the inertial readings. Its
/// landmarks are optional. Throws InputError for input that cannot be estimated from (too few
/// images, no common features, IMU that does not cover the images). A minimisation that does not
/// end, and quantities that remain undetermined, are reported (`converged` false, `reason`), not
/// thrown. So is a failed start (gravity not found, most observations contradict where it led, or
/// images alone lead elsewhere from each that is tried): its estimate is empty.
/// Image-only, the distance of the image farthest from the first is held at what the start makes
/// it.
BatchResult estimate_batch(const BatchProblem& problem, const BatchOptions& options,
                           const std::optional<Estimate>& start = std::nullopt,
                           bool want_tail = false);

}  // namespace vio
