// Fisheye camera of Kannala and Brandt.
#pragma once

#include <array>
#include <numbers>

#include "libvio/camera/camera.h"

namespace vio {

/// Intrinsics of the fisheye model, in OpenCV's, Kalibr's and MRPT's parameter order.
struct FisheyeParameters {
    int width = 0, height = 0;            ///< [px]
    double fx = 0, fy = 0;                ///< [px/rad]
    double cx = 0, cy = 0;                ///< image centre [px]
    std::array<double, 4> k{};            ///< k1 k2 k3 k4 [-]
    double max_angle = std::numbers::pi;  ///< between z and the outermost ray of the lens [rad]
};

/// With r = sqrt(X^2 + Y^2) and theta = atan2(r, Z), which may exceed 90 degrees:
///   theta_d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8)
///   u = fx theta_d X / r + cx,   v = fy theta_d Y / r + cy
/// project() follows the polynomial as far as it rises (at most short of 180 degrees), ray() ends
/// at max_angle. Source: Kannala and Brandt (2006); OpenCV's fisheye, Kalibr's "equidistant".
class FisheyeCamera final : public Camera {
 public:
    /// Throws InputError if the parameters make no camera (size, focal length or max_angle not
    /// positive, or a polynomial that falls from the start).
    explicit FisheyeCamera(const FisheyeParameters& parameters);

    std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& p_C,
                                           Matrix23d* J = nullptr) const override;
    std::optional<Ray> ray(const Eigen::Vector2d& uv_px) const override;
    int width() const override { return parameters_.width; }
    int height() const override { return parameters_.height; }
    std::string model_name() const override { return "fisheye"; }
    double angular_resolution() const override;

    const FisheyeParameters& parameters() const { return parameters_; }

 private:
    FisheyeParameters parameters_;
    double rising_to_;  ///< angle up to which theta_d rises [rad]
};

}  // namespace vio
