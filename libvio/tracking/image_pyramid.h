// The newest two images of a stream, ready for Lucas and Kanade's method.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace vio {

/// Halvings of the newest image and of the one before it, with changes of exposure undone.
class ImagePyramid {
 public:
    /// window_px: side of the window of Lucas and Kanade's method; levels: halvings.
    ImagePyramid(int window_px, int levels) : window_px_(window_px), levels_(levels) {}

    /// Takes a copy of the next image (8-bit grey). False if it has no contrast (dark, lens cap):
    /// then nothing changes.
    bool add(const cv::Mat& image);

    const cv::Mat& image() const { return newest_[0]; }
    cv::Mat half() const;
    /// Images and their derivatives alternate.
    const std::vector<cv::Mat>& newest() const { return newest_; }
    const std::vector<cv::Mat>& previous() const { return previous_; }

 private:
    int window_px_, levels_;
    std::vector<cv::Mat> newest_, previous_;
    double usual_brightness_ = 0;  // mean grey value, slow average
};

}  // namespace vio
