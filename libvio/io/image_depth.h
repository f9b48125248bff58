// Images of 16 bits a channel.
#pragma once

#include <opencv2/core.hpp>

namespace vio {

/// An image of 8 bits a channel: of 16 the high byte, as OpenCV's readers take it. Images that have
/// 8 already are not copied.
inline cv::Mat to_8_bit(const cv::Mat& image) {
    if (image.depth() != CV_16U) return image;
    cv::Mat bytes;
    image.convertTo(bytes, CV_8U, 1. / 256, -127.5 / 256);  // rounds to the nearest: down
    return bytes;
}

}  // namespace vio
