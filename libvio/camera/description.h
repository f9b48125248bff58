// A camera of any model as plain values: what files hold, and what cameras are made of.
#pragma once

#include <numbers>
#include <string>
#include <vector>

#include "libvio/camera/mirror_shape.h"
#include "libvio/camera/perspective.h"
#include "libvio/geometry/pose.h"

namespace vio {

/// Which values count depends on the model; the others are passed over.
struct CameraDescription {
    std::string model = "perspective";
    /// Size, focal lengths, centre; distortion: of the perspective model, for a fisheye k1 to k4.
    PerspectiveParameters lens;
    double min_angle = 0, max_angle = std::numbers::pi;  ///< fisheye (max), unified [rad]
    double xi = 0;                                       ///< unified [-]
    bool mirror = false;                                 ///< unified
    MirrorShapeParameters shape;  ///< mirrors; its kind follows from the model
    Pose T_C_M;                   ///< mirrors
};

/// perspective, fisheye, unified, equiangular_mirror, hyperbolic_mirror, parabolic_mirror.
const std::vector<std::string>& camera_models();
/// True for the three *_mirror models.
bool is_mirror_model(const std::string& model);

/// Throws InputError where the model is unknown or its values make no camera.
CameraPtr make_camera(const CameraDescription& description);
CameraDescription describe(const Camera& camera);

}  // namespace vio
