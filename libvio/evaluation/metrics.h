// Error metrics of associated, aligned poses.
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "libvio/evaluation/association.h"

namespace vio {

/// Statistics of a set of errors, in the unit of the errors. All zero for an empty set.
struct ErrorStatistics {
    int count = 0;
    double mean = 0, rmse = 0, median = 0, std_dev = 0, min = 0, max = 0;
};
/// std_dev is that of the population (divided by n), the median of an even number the mean of two.
ErrorStatistics statistics(std::vector<double> errors);

/// Length of the path through points [m].
double path_length(const Eigen::Matrix3Xd& points);

/// Angle of a rotation [rad], in [0, pi].
double rotation_angle(const Eigen::Matrix3d& R);

/// The rotation nearest to the mean of rotation matrices.
Eigen::Matrix3d mean_rotation(const std::vector<Eigen::Matrix3d>& rotations);

/// Relative pose error over steps of one length (Sturm et al., IROS 2012; pairs as evo's
/// `all_pairs`): E = (Q_i^-1 Q_j)^-1 (P_i^-1 P_j), Q truth, P estimate.
struct RelativeError {
    double step = 0;              ///< nominal: metres or seconds
    double mean_step = 0;         ///< of the pairs found
    ErrorStatistics translation;  ///< |E.p| [m]
    ErrorStatistics rotation;     ///< angle of E.R [rad]
};

/// Steps from every pose to the one whose distance along the true path [m] is nearest to `step`;
/// left out where it differs by more than tolerance * step.
RelativeError relative_error_over_distance(const std::vector<PosePair>& aligned, double step,
                                           double tolerance = 0.1);
/// Likewise with `step` in seconds.
RelativeError relative_error_over_time(const std::vector<PosePair>& aligned, double step,
                                       double tolerance = 0.1);

/// Normalised estimation error squared, e^T C^-1 e. If the covariance is right, its expectation is
/// the number of degrees of freedom, and 95 % lie below the chi-square bound.
struct NeesStatistics {
    int dof = 0;
    int count = 0;           ///< poses with a usable covariance
    double mean = 0;         ///< expected: dof
    double share_in_95 = 0;  ///< expected: 0.95
};
/// Normalised squared errors: 3, 3 and 6 on average where covariances are honest.
struct Nees {
    NeesStatistics position, rotation, pose;
};

/// By how much the vertical of the truth's world G is off that of the estimate's, E, in the mean
/// over the poses' attitudes [rad], and the 1-sigma that the covariances state for it.
struct WorldTilt {
    double angle = 0, sigma = 0;
};
WorldTilt world_tilt(const std::vector<PosePair>& pairs, const std::vector<Matrix6d>& covariances);

/// NEES of the poses whose covariance (6x6 in the tangent order of Pose, of T_E_B) is positive
/// definite. covariances are indexed by estimate_idx.
///
/// The estimate's world is tied to its first pose, and its covariance is relative to that pose.
/// So the two worlds are brought together there, by yaw and position, not over the whole path,
/// which would spread the error over poses that the covariance calls certain. The truth is taken as
/// exact, and its z axis as up.
Nees nees(const std::vector<PosePair>& pairs, const std::vector<Matrix6d>& covariances);

}  // namespace vio
