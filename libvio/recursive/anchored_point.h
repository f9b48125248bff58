// A point by direction and inverse distance from the camera at an earlier pose, its anchor.
//
// p_C = Q (a, b, 1) / rho in the anchor's camera frame, with a rotation Q that is chosen once so
// that a = b = 0 at first. The error of (a, b, rho) is added. Measured directions depend almost
// linearly on it, even where the distance is known to a third only (Civera, Davison and Montiel
// 2008), and a shift or a turn of the world leaves it alone.
#pragma once

#include <Eigen/Dense>

#include "libvio/geometry/pose.h"

namespace vio {

/// Direction and inverse distance in the anchor's camera frame.
struct AnchoredPoint {
    Eigen::Matrix3d Q = Eigen::Matrix3d::Identity();
    Eigen::Vector3d x = Eigen::Vector3d::UnitZ();  ///< a [-], b [-], rho [1/m]

    /// Nearer than infinity: otherwise the point has no position.
    bool in_front() const { return x.z() > 1e-5; }
};

/// Position in W and its derivatives with respect to the anchor pose T_W_I, to (a, b, rho) and to
/// T_I_C.
struct PlacedPoint {
    Eigen::Vector3d p_W;
    Eigen::Matrix3d J_rotation;  ///< with respect to the anchor's position it is the identity
    Eigen::Matrix3d J_point;
    Eigen::Matrix<double, 3, 6> J_camera;
};

/// The point must be in_front().
PlacedPoint placed(const AnchoredPoint& point, const Pose& T_W_I, const Pose& T_I_C);

/// The point p_W seen from the camera at T_W_I; its Q makes a = b = 0.
AnchoredPoint anchored(const Eigen::Vector3d& p_W, const Pose& T_W_I, const Pose& T_I_C);

/// A point moved to another anchor: new error = J_point old error + J_from error of the old anchor
/// + J_to error of the new one + J_camera error of T_I_C.
struct MovedPoint {
    AnchoredPoint point;
    Eigen::Matrix3d J_point;
    Eigen::Matrix<double, 3, 6> J_from, J_to, J_camera;
};
MovedPoint moved_anchor(const AnchoredPoint& point, const Pose& T_W_I_from, const Pose& T_W_I_to,
                        const Pose& T_I_C);

}  // namespace vio
