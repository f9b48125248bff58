// Which pairs of rays agree with one rigid motion between two images.
#pragma once

#include <Eigen/Dense>
#include <optional>
#include <vector>

namespace vio {

/// Directions (unit vectors) to one feature from two camera positions, each in its camera frame.
struct RayPair {
    Eigen::Vector3d f1, f2;
};

/// What an inlier is, and how long to search.
struct TwoViewOptions {
    double threshold = 0;  ///< largest angular residual of an inlier [rad]
    int max_hypotheses = 200;
    unsigned long long seed = 1;  ///< of the sampling
};

/// Rotation and direction of the translation between two cameras, and who agrees.
struct TwoViewMotion {
    Eigen::Matrix3d R_C1_C2 = Eigen::Matrix3d::Identity();
    Eigen::Vector3d t_C1 = Eigen::Vector3d::UnitZ();  ///< direction of C2 seen from C1, unit vector
    std::vector<char> inlier;                         ///< per pair
    int inliers = 0;
};

/// Angle by which a pair misses the epipolar geometry [rad], to first order (Sampson's error on the
/// unit sphere). A pair that lies on its epipolar line but has moved against the motion (depth
/// would be negative) has the whole displacement as its residual. Never more than the angle between
/// f1 and R_C1_C2 f2, so that pairs without parallax fit any translation: a camera that only
/// rotates needs no case of its own.
double two_view_residual(const RayPair& pair, const Eigen::Matrix3d& R_C1_C2,
                         const Eigen::Vector3d& t_C1);

/// Robust estimate (RANSAC, then Gauss-Newton over rotation and direction). With a rotation, from
/// the gyro, two pairs make a hypothesis, t ~ (g_i x f_i) x (g_j x f_j) with g = R f2; if fewer
/// than half of the pairs agree with it, if what agrees turns otherwise (by 0.2 rad), or without a
/// rotation, five pairs do (Newton's method from the rotation that aligns them best). Rays are
/// taken as if from one viewpoint: origins of mirrors' rays are small against the scene. Nothing if
/// there are fewer than eight pairs.
std::optional<TwoViewMotion> estimate_two_view(const std::vector<RayPair>& pairs,
                                               const std::optional<Eigen::Matrix3d>& R_C1_C2,
                                               const TwoViewOptions& options);

}  // namespace vio
