// Feature tracks drawn on images.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "libvio/base/types.h"

namespace vio {

struct OverlayOptions {
    int tail_images = 15;  ///< length of the tails
    int scale = 1;         ///< enlargement of the picture, for small images
};

/// The image in BGR with every feature of the last frame and its tail through the earlier ones
/// (frames in order of time, the last belongs to the image). Colour tells the age of the track:
/// new ones blue, those older than the tail yellow.
cv::Mat draw_tracks(const cv::Mat& image, const std::vector<FeatureFrame>& frames,
                    const OverlayOptions& options = {});

}  // namespace vio
