// Rotation group SO(3): exponential, logarithm and Jacobians.
//
// Convention of the whole project: right perturbation, R [+] theta = R exp(skew(theta)).
#pragma once

#include <Eigen/Dense>

namespace vio::so3 {

/// Cross-product matrix, Eq. (7): skew(a) b = a x b.
Eigen::Matrix3d skew(const Eigen::Vector3d& a);

/// Rotation matrix of a rotation vector [rad] (Rodrigues), Eq. (6).
Eigen::Matrix3d exp(const Eigen::Vector3d& rotation_vector);

/// Rotation vector [rad] of a rotation matrix, norm in [0, pi]; accurate near 0 and near pi.
Eigen::Vector3d log(const Eigen::Matrix3d& R);

/// Right Jacobian: exp(theta + d) = exp(theta) exp(Jr(theta) d) + O(d^2).
Eigen::Matrix3d right_jacobian(const Eigen::Vector3d& rotation_vector);

/// Inverse of the right Jacobian; defined for |theta| < 2 pi.
Eigen::Matrix3d right_jacobian_inverse(const Eigen::Vector3d& rotation_vector);

/// Nearest rotation to a matrix that has drifted slightly (one Newton step of the polar factor).
Eigen::Matrix3d normalized(const Eigen::Matrix3d& R);

/// Smallest rotation that turns unit(from) into unit(to); any perpendicular axis when opposite.
Eigen::Matrix3d rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

}  // namespace vio::so3
