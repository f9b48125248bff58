// Perspective camera with radial and tangential distortion.
#pragma once

#include <array>

#include "libvio/camera/camera.h"

namespace vio {

/// Intrinsics of the perspective model, in OpenCV's and MRPT's parameter order.
struct PerspectiveParameters {
    int width = 0, height = 0;  ///< [px]
    double fx = 0, fy = 0;      ///< focal lengths [px]
    double cx = 0, cy = 0;      ///< image centre [px]
    /// k1 k2 p1 p2 k3 k4 k5 k6 [-]; zeros where absent.
    std::array<double, 8> distortion{};
};

/// With x = X/Z, y = Y/Z, r2 = x^2 + y^2:
///   L  = (1 + k1 r2 + k2 r2^2 + k3 r2^3) / (1 + k4 r2 + k5 r2^2 + k6 r2^3)
///   xd = x L + 2 p1 x y + p2 (r2 + 2 x^2),   yd = y L + p1 (r2 + 2 y^2) + 2 p2 x y
///   u  = fx xd + cx,                         v  = fy yd + cy
/// Points beyond the radius at which the distortion stops being monotonic are not imaged.
/// Source: Heikkila and Silven (1997); OpenCV's calib3d.
class PerspectiveCamera final : public Camera {
 public:
    /// Throws InputError if the parameters make no camera (size or focal length not positive).
    explicit PerspectiveCamera(const PerspectiveParameters& parameters);

    std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& p_C,
                                           Matrix23d* J = nullptr) const override;
    std::optional<Ray> ray(const Eigen::Vector2d& uv_px) const override;
    int width() const override { return parameters_.width; }
    int height() const override { return parameters_.height; }
    std::string model_name() const override { return "perspective"; }
    double angular_resolution() const override;

    const PerspectiveParameters& parameters() const { return parameters_; }

 private:
    Eigen::Vector2d distort(const Eigen::Vector2d& xy, Eigen::Matrix2d* J) const;

    PerspectiveParameters parameters_;
    double max_radius2_;  ///< r2 up to which the radial distortion is monotonic
};

}  // namespace vio
