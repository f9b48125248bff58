// Closed-form alignment of two paths, Eq. (26).
#pragma once

#include <Eigen/Dense>
#include <string>

#include "libvio/geometry/pose.h"

namespace vio {

enum class AlignmentKind { kNone, kYawPosition, kSE3, kSim3 };

/// "none", "yaw+position", "SE(3)" or "Sim(3)".
std::string to_string(AlignmentKind kind);

/// Why an alignment is or is not determined by its points.
enum class AlignmentStatus {
    kDetermined,
    kTooFewPoints,  ///< fewer than two; one point fixes the translation only
    kStationary,    ///< all points of a set coincide (for kYawPosition: as seen from above)
    kCollinear,     ///< on a line: the rotation about it is arbitrary, the scale is still right
};

/// Similarity transformation: maps coordinates in the estimate's world E to the truth's world G,
/// p_G = s R p_E + p.
struct Similarity {
    double s = 1;
    Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
    Eigen::Vector3d p = Eigen::Vector3d::Zero();

    Eigen::Vector3d operator*(const Eigen::Vector3d& p_E) const { return s * (R * p_E) + p; }
    Pose operator*(const Pose& T_E_B) const { return {R * T_E_B.R, *this * T_E_B.p}; }
    Similarity inverse() const { return {1 / s, R.transpose(), -(R.transpose() * p) / s}; }
};

/// The similarity that brings E onto G, and whether the points determine it.
struct Alignment {
    AlignmentKind kind = AlignmentKind::kNone;
    AlignmentStatus status = AlignmentStatus::kDetermined;
    /// Minimiser of the squared distances; where not determined, one of the minimisers.
    Similarity S_G_E;
};

/// Minimises sum_i |p_G_i - (s R p_E_i + p)|^2 over the transformations of `kind` (s = 1 unless
/// kSim3; R about z for kYawPosition), by Umeyama, PAMI 13(4), 1991, and for the yaw by its normal
/// equation. Columns correspond; both matrices are 3 x n and finite [m].
/// A set counts as a line when it is more than 10^4 times as long as it is wide.
Alignment align(const Eigen::Matrix3Xd& p_E, const Eigen::Matrix3Xd& p_G, AlignmentKind kind);

/// Yaw and position that bring one pose onto another: the rotation about z that leaves the smallest
/// angle between the attitudes, then the translation. Fixes the four directions in which an
/// estimate from image and inertial data is free, where its covariance is expressed: at one pose.
Similarity align_yaw_position(const Pose& T_E_B, const Pose& T_G_B);

}  // namespace vio
