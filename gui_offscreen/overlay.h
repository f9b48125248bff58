// Feature tracks drawn on images.
#pragma once

#include <opencv2/core.hpp>
#include <unordered_set>
#include <vector>

#include "libvio/base/types.h"

namespace vio {

/// How tracks are drawn; lengths in images.
struct OverlayOptions {
    int tail_images = 15;  ///< length of the tails
    int ended_images = 5;  ///< for which a track that is no longer seen stays in the picture
    int scale = 1;         ///< enlargement of the picture, for small images
};

/// The image in BGR with every feature of the last frame and its tail through the earlier ones
/// (frames in order of time, the last belongs to the image). Colour tells the age of the track:
/// new ones blue, those older than the tail yellow. Tracks that the last frame lacks are marked
/// where they were seen last: a red cross for those in `rejected` (against the motion of the
/// camera), a grey ring for the others (left the image or not found).
cv::Mat draw_tracks(const cv::Mat& image, const std::vector<FeatureFrame>& frames,
                    const std::unordered_set<FeatureId>& rejected = {},
                    const OverlayOptions& options = {});

/// Writes what the marks of draw_tracks() mean into the lower left corner of a BGR picture.
void draw_track_key(cv::Mat& picture);

}  // namespace vio
