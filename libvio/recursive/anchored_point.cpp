#include "libvio/recursive/anchored_point.h"

#include "libvio/geometry/so3.h"

namespace vio {

using Eigen::Matrix3d;
using Eigen::Vector3d;

PlacedPoint placed(const AnchoredPoint& point, const Pose& T_W_I, const Pose& T_I_C) {
    const double rho = point.x.z();
    const Vector3d direction(point.x.x(), point.x.y(), 1);
    const Matrix3d R_I_Q = T_I_C.R * point.Q;
    const Vector3d p_C = point.Q * direction / rho, p_I = T_I_C * p_C;
    Matrix3d J;  // of direction / rho
    J << 1 / rho, 0, -direction.x() / (rho * rho), 0, 1 / rho, -direction.y() / (rho * rho), 0, 0,
        -1 / (rho * rho);
    PlacedPoint place{T_W_I * p_I, -T_W_I.R * so3::skew(p_I), T_W_I.R * R_I_Q * J, {}};
    place.J_camera << -T_W_I.R * T_I_C.R * so3::skew(p_C), T_W_I.R;
    return place;
}

AnchoredPoint anchored(const Vector3d& p_W, const Pose& T_W_I, const Pose& T_I_C) {
    const Vector3d p_C = (T_W_I * T_I_C).inverse() * p_W;
    const double distance = p_C.norm();
    AnchoredPoint point;
    point.Q = Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), p_C).toRotationMatrix();
    point.x = {0, 0, 1 / distance};
    return point;
}

MovedPoint moved_anchor(const AnchoredPoint& point, const Pose& T_W_I_from, const Pose& T_W_I_to,
                        const Pose& T_I_C) {
    const PlacedPoint from = placed(point, T_W_I_from, T_I_C);
    MovedPoint moved;
    moved.point = anchored(from.p_W, T_W_I_to, T_I_C);
    const PlacedPoint to = placed(moved.point, T_W_I_to, T_I_C);
    // The same dp_W either way.
    const Matrix3d inverse = to.J_point.inverse();
    moved.J_point = inverse * from.J_point;
    moved.J_from << inverse * from.J_rotation, inverse;
    moved.J_to << -inverse * to.J_rotation, -inverse;
    moved.J_camera = inverse * (from.J_camera - to.J_camera);
    return moved;
}

}  // namespace vio
