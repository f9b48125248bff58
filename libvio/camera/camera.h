// What every camera model offers: point to pixel, and pixel to ray.
#pragma once

#include <Eigen/Dense>
#include <memory>
#include <optional>
#include <string>

#include "libvio/base/types.h"

namespace vio {

/// A half-line in the camera frame C. Its origin differs from zero for cameras without a single
/// viewpoint (mirrors).
struct Ray {
    Eigen::Vector3d origin = Eigen::Vector3d::Zero();      ///< [m]
    Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  ///< unit vector
};

/// Projection model. Camera frame C: z forward, x right, y down. Pixel (0, 0) is the centre of the
/// top-left pixel. Implementations are immutable and safe to share between threads.
class Camera {
 public:
    virtual ~Camera() = default;

    /// Pixel of the point p_C [m], whether or not it lies inside the image or the region that sees
    /// the world; nothing where the model cannot image it (behind a perspective camera or a mirror,
    /// beyond the field that the formula holds for).
    /// J, if given, receives d uv / d p_C [px/m].
    virtual std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& p_C,
                                                   Matrix23d* J = nullptr) const = 0;

    /// Ray of a pixel; nothing where no ray reaches that pixel: outside a fisheye's circle, beside
    /// a mirror, in the middle of a mirror, where the camera sees itself. This is the valid region
    /// of the image. project(origin + s direction) is uv_px for every s > 0.
    virtual std::optional<Ray> ray(const Eigen::Vector2d& uv_px) const = 0;

    virtual int width() const = 0;   ///< [px]
    virtual int height() const = 0;  ///< [px]
    virtual std::string model_name() const = 0;

    /// Typical angular size of a pixel [rad/px], for thresholds given in pixels.
    virtual double angular_resolution() const = 0;

    bool inside_image(const Eigen::Vector2d& uv_px, double border_px = 0) const {
        return uv_px.x() >= border_px && uv_px.y() >= border_px &&
               uv_px.x() <= width() - 1 - border_px && uv_px.y() <= height() - 1 - border_px;
    }
};

using CameraPtr = std::shared_ptr<const Camera>;

}  // namespace vio
