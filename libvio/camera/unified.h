// Unified model of cameras with a single viewpoint: hyperbolic and parabolic mirrors, wide lenses.
#pragma once

#include <numbers>

#include "libvio/camera/perspective.h"

namespace vio {

/// Projection onto a unit sphere, then from a point of its axis; distances in its radius.
struct UnifiedParameters {
    PerspectiveParameters lens;  ///< of the projection from the sphere
    double xi = 0;  ///< distance of the centre of projection from the sphere's centre [-]: 0
                    ///< perspective, 2e / (1 + e^2) a hyperbola of eccentricity e, 1 a parabola
    /// Mirror: C is turned as the camera that looks at the mirror, hence the image's centre looks
    /// along -z. Otherwise (lens) along z.
    bool mirror = false;
    double min_angle = 0;  ///< blind spot, measured from where the centre looks [rad]
    double max_angle = std::numbers::pi;  ///< rim, likewise [rad]
};

/// With s = p / |p| (z negated for a mirror), the lens' projection of s + (0, 0, xi).
/// A point is imaged where the sphere is pierced once: s_z > -xi for xi <= 1, else s_z > -1 / xi.
/// ray() ends at min_angle and max_angle. C's origin is the viewpoint: a mirror's inner focus.
/// Source: Geyer and Daniilidis (2000); Mei and Rives (2007); Kalibr's "omni".
class UnifiedCamera final : public Camera {
 public:
    /// Throws InputError if the parameters make no camera.
    explicit UnifiedCamera(const UnifiedParameters& parameters);

    std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& p_C,
                                           Matrix23d* J = nullptr) const override;
    std::optional<Ray> ray(const Eigen::Vector2d& uv_px) const override;
    int width() const override { return lens_.width(); }
    int height() const override { return lens_.height(); }
    std::string model_name() const override { return "unified"; }
    double angular_resolution() const override {
        return (1 + parameters_.xi) * lens_.angular_resolution();
    }

    const UnifiedParameters& parameters() const { return parameters_; }

 private:
    UnifiedParameters parameters_;
    PerspectiveCamera lens_;
    double least_z_;  ///< of s
    double z_sign_;   ///< -1 for a mirror
};

}  // namespace vio
