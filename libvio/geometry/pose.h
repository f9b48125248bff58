// Rigid transformation SE(3).
#pragma once

#include <Eigen/Dense>

#include "libvio/base/types.h"
#include "libvio/geometry/so3.h"

namespace vio {

/// T_A_B: maps coordinates in frame B to frame A, p_A = R p_B + p.
///
/// Tangent order everywhere in the project: (rotation, translation), rotation perturbed on the
/// right, translation added in A: T [+] (theta, d) = (R exp(theta), p + d).
struct Pose {
    Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
    Eigen::Vector3d p = Eigen::Vector3d::Zero();

    Eigen::Vector3d operator*(const Eigen::Vector3d& point) const { return R * point + p; }
    Pose operator*(const Pose& other) const { return {R * other.R, R * other.p + p}; }
    Pose inverse() const { return {R.transpose(), -(R.transpose() * p)}; }

    Pose boxplus(const Vector6d& d) const {
        return {so3::normalized(R * so3::exp(d.head<3>())), p + d.tail<3>()};
    }
    /// d such that other.boxplus(d) == *this.
    Vector6d boxminus(const Pose& other) const {
        Vector6d d;
        d << so3::log(other.R.transpose() * R), p - other.p;
        return d;
    }
};

/// Pose of the body at a time: one row of a trajectory.
struct TimedPose {
    TimeNs t = 0;
    Pose T_W_B;
};

/// d (T_A_B * T_B_C) / d T_A_B in the tangent order above: maps the covariance of T_A_B to that of
/// T_A_C when T_B_C is known exactly.
inline Matrix6d right_compose_jacobian(const Pose& T_A_B, const Pose& T_B_C) {
    Matrix6d J = Matrix6d::Zero();
    J.topLeftCorner<3, 3>() = T_B_C.R.transpose();
    J.bottomLeftCorner<3, 3>() = -T_A_B.R * so3::skew(T_B_C.p);
    J.bottomRightCorner<3, 3>().setIdentity();
    return J;
}

}  // namespace vio
