// Poses and points from the rays of features alone: a small bundle adjustment.
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "libvio/geometry/pose.h"

namespace vio {

/// Views and points up to a similarity, from unit rays. A point is a unit 4-vector h = (x, w): the
/// place x / w, or the direction x if w = 0, so that far points need no case of their own.
///
/// A ray m of point h in view (R, p) should be the direction u of q = R^T (x - w p). The residual
/// is r = B u [rad], with the rows of B (2x3) a basis of the plane perpendicular to m; its cost is
/// Cauchy's, s^2 log(1 + |r|^2 / s^2). With right perturbation of R and h moved in its tangent
/// space:
///   du = (I - u u^T) / |q| dq,   dq/dR = skew(q),  dq/dp = -w R^T,  dq/dh = R^T [I, -p].
struct RayBundle {
    /// A feature's direction as one view saw it.
    struct Ray {
        Ray(int view, const Eigen::Vector3d& direction);
        int view_idx;
        Eigen::Vector3d m;              ///< unit vector in the view's frame
        Eigen::Matrix<double, 2, 3> B;  ///< see above
    };
    /// A point in W, unit 4-vector (place or direction, see above), and the rays that saw it.
    struct Point {
        Eigen::Vector4d h = Eigen::Vector4d::UnitZ();
        std::vector<Ray> rays;
    };

    std::vector<Pose> T_W_C;  ///< of the views; the first stays where it is
    std::vector<Point> points;
    double scale = 1e-3;  ///< s, about a good ray's error [rad]

    /// h of the point that fits its rays best for the views' poses: linear, then Gauss-Newton with
    /// the robust cost. A point that would be beyond infinity is put there (w = 0).
    void triangulate(Point& point) const;

    /// Levenberg-Marquardt over all views but the first and all points, points eliminated (Schur
    /// complement). Stops when an iteration gains less than 1e-3 of the cost, or after
    /// `iterations`. Returns the cost [rad^2].
    double minimize(int iterations);

    /// Angle between a ray and the direction of its point [rad], pi if the point lies behind.
    double error(const Ray& ray, const Eigen::Vector4d& h) const;
};

}  // namespace vio
