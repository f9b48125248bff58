#include "gui_offscreen/framing.h"

#include <algorithm>
#include <cmath>

namespace vio {

using Eigen::Vector3d;

std::vector<Vector3d> nearby_points(const std::vector<Vector3d>& path,
                                    const std::vector<Vector3d>& landmarks, double reach) {
    Eigen::AlignedBox3d box;
    for (const Vector3d& p : path) box.extend(p);
    if (box.isEmpty() || landmarks.empty()) return {};
    const double grown = std::max(reach * box.diagonal().norm(), 1e-3);
    box.extend(Vector3d(box.max().array() + grown));
    box.extend(Vector3d(box.min().array() - grown));
    std::vector<Vector3d> inside;
    for (const Vector3d& p : landmarks)
        if (box.contains(p)) inside.push_back(p);
    if (inside.size() < 10) return inside;

    Eigen::AlignedBox3d core(Vector3d::Zero(), Vector3d::Zero());
    for (int axis = 0; axis < 3; ++axis) {
        std::vector<double> x;
        for (const Vector3d& p : inside) x.push_back(p[axis]);
        std::sort(x.begin(), x.end());
        core.min()[axis] = x[x.size() / 50];
        core.max()[axis] = x[x.size() - 1 - x.size() / 50];
    }
    std::erase_if(inside, [&](const Vector3d& p) { return !core.contains(p); });
    return inside;
}

Eigen::Matrix3d look_along(const Vector3d& forward) {
    const Vector3d z = forward.normalized();
    Vector3d x = z.cross(Vector3d::UnitZ());
    x = x.norm() > 1e-6 ? x.normalized() : Vector3d::UnitX();
    Eigen::Matrix3d R;
    R << x, z.cross(x), z;
    return R;
}

CameraPlacement frame_points(const std::vector<Vector3d>& points, const Eigen::Matrix3d& R_W_C,
                             int width, int height, double half_view_rad, double margin) {
    CameraPlacement camera;
    camera.T_W_C.R = R_W_C;
    camera.focal_px = 0.5 * std::max(width, height) / std::tan(half_view_rad);
    // Each side of the picture is a plane through the camera; along each axis of the picture the
    // two planes that touch the points determine where the camera is, and how far back it must
    // stand.
    const Eigen::Vector2d tangent =
        (1 - 2 * margin) * Eigen::Vector2d(width, height) / (2 * camera.focal_px);
    Vector3d position = Vector3d::Zero();  // in a frame parallel to the camera's
    double depth_min = INFINITY, depth_max = -INFINITY, back = INFINITY;
    Eigen::Vector2d low, high;
    for (int axis = 0; axis < 2; ++axis) {
        low[axis] = INFINITY, high[axis] = -INFINITY;
        for (const Vector3d& p_W : points) {
            const Vector3d p = R_W_C.transpose() * p_W;
            low[axis] = std::min(low[axis], p[axis] + tangent[axis] * p.z());
            high[axis] = std::max(high[axis], p[axis] - tangent[axis] * p.z());
            depth_min = std::min(depth_min, p.z());
            depth_max = std::max(depth_max, p.z());
        }
        position[axis] = 0.5 * (low[axis] + high[axis]);
        back = std::min(back, 0.5 * (low[axis] - high[axis]) / tangent[axis]);
    }
    const double extent = std::max(depth_max - depth_min, 1e-6);
    position.z() = std::min(back, depth_min - 0.05 * extent);
    camera.T_W_C.p = R_W_C * position;
    camera.near_m = std::max(0.2 * (depth_min - position.z()), 1e-3 * extent);
    camera.far_m = 4 * (depth_max - position.z()) + 10 * extent;
    return camera;
}

CameraPlacement frame_path(const std::vector<Vector3d>& path,
                           const std::vector<Vector3d>& surroundings, const Eigen::Matrix3d& R_W_C,
                           int width, int height, double half_view_rad) {
    std::vector<Vector3d> all = path;
    all.insert(all.end(), surroundings.begin(), surroundings.end());
    CameraPlacement camera = frame_points(path, R_W_C, width, height, half_view_rad);
    const CameraPlacement wide = frame_points(all, R_W_C, width, height, half_view_rad);
    Eigen::AlignedBox3d box;
    for (const Vector3d& p : path) box.extend(p);
    // The places from which a camera of fixed rotation sees given points form a convex set (each
    // side of the picture is a half-space), so every place between the two sees the whole path.
    const Vector3d step = wide.T_W_C.p - camera.T_W_C.p;
    const double distance = (box.center() - camera.T_W_C.p).norm();
    camera.T_W_C.p += std::min(1.0, 0.5 * distance / std::max(step.norm(), 1e-12)) * step;
    camera.near_m = 0.02 * distance;
    camera.far_m = 4 * std::max(distance, 0.25 * wide.far_m);
    return camera;
}

}  // namespace vio
