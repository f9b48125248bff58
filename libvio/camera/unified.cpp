#include "libvio/camera/unified.h"

#include <cmath>

#include "libvio/base/errors.h"

namespace vio {
namespace {

constexpr double kGrazing = 1e-6;    // kept off s_z's limit
constexpr double kAngleEdge = 1e-9;  // rounding at min_angle and max_angle [rad]

}  // namespace

UnifiedCamera::UnifiedCamera(const UnifiedParameters& parameters)
    : parameters_(parameters), lens_(parameters.lens), z_sign_(parameters.mirror ? -1 : 1) {
    const double xi = parameters.xi;
    if (!(xi >= 0) || !std::isfinite(xi))
        throw InputError("camera calibration: xi of the unified model must not be negative");
    if (!(parameters.min_angle >= 0 && parameters.max_angle > parameters.min_angle))
        throw InputError(
            "camera calibration: max_angle must exceed min_angle, and both be positive");
    least_z_ = -(xi <= 1 ? xi : 1 / xi) + kGrazing;
}

std::optional<Eigen::Vector2d> UnifiedCamera::project(const Eigen::Vector3d& p_C,
                                                      Matrix23d* J) const {
    const double inverse_norm = 1 / p_C.norm();
    Eigen::Vector3d s = p_C * inverse_norm;
    s.z() *= z_sign_;
    if (!(s.z() > least_z_)) return std::nullopt;
    Matrix23d J_lens;
    const auto uv = lens_.project(s + Eigen::Vector3d(0, 0, parameters_.xi), J ? &J_lens : nullptr);
    if (uv && J) {
        *J = inverse_norm * (J_lens - (J_lens * s) * s.transpose());
        J->col(2) *= z_sign_;
    }
    return uv;
}

std::optional<Ray> UnifiedCamera::ray(const Eigen::Vector2d& uv_px) const {
    const auto seen = lens_.ray(uv_px);
    if (!seen) return std::nullopt;
    // s = a d - (0, 0, xi) of unit length, the root that is in front.
    const Eigen::Vector3d& d = seen->direction;
    const double xi = parameters_.xi;
    const double under_root = 1 - xi * xi * d.head<2>().squaredNorm();
    if (!(under_root >= 0)) return std::nullopt;
    Eigen::Vector3d s = (xi * d.z() + std::sqrt(under_root)) * d - Eigen::Vector3d(0, 0, xi);
    if (!(s.z() > least_z_)) return std::nullopt;
    const double angle = std::atan2(s.head<2>().norm(), s.z());
    if (angle < parameters_.min_angle - kAngleEdge || angle > parameters_.max_angle + kAngleEdge)
        return std::nullopt;
    s.z() *= z_sign_;
    return Ray{Eigen::Vector3d::Zero(), s.normalized()};
}

}  // namespace vio
