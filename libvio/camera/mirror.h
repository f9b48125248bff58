// A camera that looks into a convex mirror, each in its own place.
#pragma once

#include "libvio/camera/mirror_shape.h"
#include "libvio/camera/perspective.h"
#include "libvio/geometry/pose.h"

namespace vio {

/// Camera, mirror, and the place of one before the other.
struct MirrorParameters {
    /// The camera itself. Before a parabolic mirror it is telecentric: fx and fy in px/m, no
    /// distortion.
    PerspectiveParameters lens;
    MirrorShapeParameters shape;
    Pose T_C_M;  ///< mirror in the camera frame; identity: perfectly aligned
};

/// C is the frame of the camera itself: z points to the mirror, and the image's centre sees what
/// lies in the direction -z. Not a single viewpoint in general: rays start on the mirror.
/// project() finds the mirror point m at which the light's path p - m - camera is stationary
/// (Fermat) by Newton's method in two surface coordinates q: with unit vectors u1 from camera to m
/// and u2 from m to p, m_q^T (u1 - u2) = 0. Its Jacobian follows by the implicit function theorem,
/// dq / dp = -L_qq^-1 L_qp. It continues the shape a little beyond the rim and into the blind spot,
/// so that noise does not end an observation there; ray() does not.
class MirrorCamera final : public Camera {
 public:
    /// Throws InputError if the parameters make no camera.
    explicit MirrorCamera(const MirrorParameters& parameters);

    std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& p_C,
                                           Matrix23d* J = nullptr) const override;
    std::optional<Ray> ray(const Eigen::Vector2d& uv_px) const override;
    int width() const override { return parameters_.lens.width; }
    int height() const override { return parameters_.lens.height; }
    std::string model_name() const override { return shape_.name(); }
    double angular_resolution() const override { return angular_resolution_; }

    const MirrorParameters& parameters() const { return parameters_; }

    /// project() with d uv / d T_C_M [px/rad, px/m] in the pose's tangent order, for calibration.
    std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& p_C, Matrix23d* J,
                                           Eigen::Matrix<double, 2, 6>* J_T_C_M) const;

 private:
    struct Reflection;
    std::optional<Reflection> reflect(const Eigen::Vector3d& p_M) const;
    std::optional<Eigen::Vector2d> lens_project(const Eigen::Vector3d& m_C, Matrix23d* J) const;
    std::optional<Ray> lens_ray(const Eigen::Vector2d& uv_px) const;

    MirrorParameters parameters_;
    MirrorShape shape_;
    PerspectiveCamera lens_;
    Pose T_M_C_;
    double angular_resolution_;
};

}  // namespace vio
