// Whether images show something, and something new.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "libvio/base/types.h"
#include "libvio/check/finding.h"

namespace vio {

/// Brightness and contrast of images, and those that equal their predecessor.
class ImageQuality {
 public:
    /// 8-bit grey, in order of time.
    void add(const cv::Mat& image);
    /// Nothing if there were no images.
    std::vector<Finding> findings() const;

 private:
    int images_ = 0, dark_ = 0, bright_ = 0, blank_ = 0, repeated_ = 0;
    double mean_ = 0;   ///< sum of the images' means
    cv::Mat previous_;  ///< every few pixels of it
};

/// Number and length of feature tracks.
class TrackQuality {
 public:
    /// In order of time.
    void add(const FeatureFrame& frame);
    std::vector<Finding> findings() const;

 private:
    std::vector<FeatureId> previous_;
    std::vector<int> counts_;
    std::size_t observations_ = 0, tracks_ = 0;
};

}  // namespace vio
