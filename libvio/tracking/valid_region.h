// The part of a camera's image that sees the world.
#pragma once

#include <opencv2/core.hpp>

#include "libvio/camera/camera.h"

namespace vio {

/// 8-bit mask of the camera's size: 0 where a pixel, or one within border_px of it, has no ray
/// (outside a fisheye's circle, beside a mirror, its blind middle), 255 elsewhere. Empty if all
/// pixels see.
cv::Mat valid_region(const Camera& camera, int border_px);

}  // namespace vio
