#include "libvio/camera/perspective.h"

#include <Eigen/Dense>
#include <cmath>

#include "libvio/base/errors.h"

namespace vio {
namespace {

constexpr double kLargestRadius = 10;  // tangent of the widest half angle that is considered
constexpr double kSmallestDepth = 1e-6;

struct Radial {
    double factor, derivative;  // L and dL / d r2
};

Radial radial(const std::array<double, 8>& k, double r2) {
    const double num = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
    const double den = 1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
    const double dnum = k[0] + r2 * (2 * k[1] + r2 * 3 * k[4]);
    const double dden = k[5] + r2 * (2 * k[6] + r2 * 3 * k[7]);
    const double inverse = 1 / den, factor = num * inverse;
    return {factor, (dnum - factor * dden) * inverse};
}

// First r at which d(r L)/dr stops being positive.
double monotonic_radius(const std::array<double, 8>& k) {
    constexpr int kSteps = 10000;
    for (int i = 1; i <= kSteps; ++i) {
        const double r = kLargestRadius * i / kSteps, r2 = r * r;
        const Radial L = radial(k, r2);
        if (!(L.factor + 2 * r2 * L.derivative > 1e-3)) return kLargestRadius * (i - 1) / kSteps;
    }
    return kLargestRadius;
}

}  // namespace

PerspectiveCamera::PerspectiveCamera(const PerspectiveParameters& parameters)
    : parameters_(parameters) {
    if (parameters.width <= 0 || parameters.height <= 0 || !(parameters.fx > 0) ||
        !(parameters.fy > 0))
        throw InputError(
            "camera calibration: image size and focal lengths must be positive; give the camera's "
            "intrinsics");
    const double r = monotonic_radius(parameters.distortion);
    const double corner =
        std::hypot(std::max(parameters.cx, parameters.width - parameters.cx) / parameters.fx,
                   std::max(parameters.cy, parameters.height - parameters.cy) / parameters.fy);
    constexpr double kLeast = 0.1;  // of the image's radius: less is no lens
    if (!(r > kLeast * corner))
        throw InputError(
            "camera calibration: with this distortion the image's radius does not rise with the "
            "angle; check the coefficients and their order");
    max_radius2_ = r * r;
}

double PerspectiveCamera::angular_resolution() const {
    return 1 / std::sqrt(parameters_.fx * parameters_.fy);
}

Eigen::Vector2d PerspectiveCamera::distort(const Eigen::Vector2d& xy, Eigen::Matrix2d* J) const {
    const auto& k = parameters_.distortion;
    const double x = xy.x(), y = xy.y(), p1 = k[2], p2 = k[3];
    const double r2 = x * x + y * y;
    const Radial L = radial(k, r2);
    if (J) {
        const double cross = 2 * x * y * L.derivative + 2 * p1 * x + 2 * p2 * y;
        *J << L.factor + 2 * x * x * L.derivative + 2 * p1 * y + 6 * p2 * x, cross,  //
            cross, L.factor + 2 * y * y * L.derivative + 6 * p1 * y + 2 * p2 * x;
    }
    return {x * L.factor + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * L.factor + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y};
}

std::optional<Eigen::Vector2d> PerspectiveCamera::project(const Eigen::Vector3d& p_C,
                                                          Matrix23d* J) const {
    if (!(p_C.z() > kSmallestDepth)) return std::nullopt;
    const double inverse_z = 1 / p_C.z();
    const Eigen::Vector2d xy = p_C.head<2>() * inverse_z;
    if (!(xy.squaredNorm() <= max_radius2_)) return std::nullopt;
    Eigen::Matrix2d D;
    const Eigen::Vector2d d = distort(xy, J ? &D : nullptr);
    if (J) {
        D.row(0) *= parameters_.fx;
        D.row(1) *= parameters_.fy;
        J->leftCols<2>() = D * inverse_z;
        J->col(2) = -(D * xy) * inverse_z;
    }
    return Eigen::Vector2d(parameters_.fx * d.x() + parameters_.cx,
                           parameters_.fy * d.y() + parameters_.cy);
}

std::optional<Ray> PerspectiveCamera::ray(const Eigen::Vector2d& uv_px) const {
    const Eigen::Vector2d target((uv_px.x() - parameters_.cx) / parameters_.fx,
                                 (uv_px.y() - parameters_.cy) / parameters_.fy);
    // Newton's method on the distortion, step limited so as to stay in the monotonic region.
    Eigen::Vector2d xy = target;
    if (xy.squaredNorm() > max_radius2_) xy *= 0.9 * std::sqrt(max_radius2_ / xy.squaredNorm());
    constexpr int kMaxIterations = 50;
    for (int i = 0; i < kMaxIterations; ++i) {
        Eigen::Matrix2d J;
        const Eigen::Vector2d error = distort(xy, &J) - target;
        Eigen::Vector2d next = xy - J.inverse() * error;
        if (!next.allFinite()) return std::nullopt;
        if (next.squaredNorm() > max_radius2_)
            next = 0.5 * (xy + next * std::sqrt(max_radius2_ / next.squaredNorm()));
        const double step = (next - xy).norm();
        xy = next;
        if (step < 1e-15 * (1 + xy.norm())) break;
    }
    if ((distort(xy, nullptr) - target).norm() > 1e-11 * (1 + target.norm())) return std::nullopt;
    return Ray{Eigen::Vector3d::Zero(), Eigen::Vector3d(xy.x(), xy.y(), 1).normalized()};
}

}  // namespace vio
