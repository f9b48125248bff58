// Colours of landmarks from the images.
#pragma once

#include <deque>
#include <unordered_map>
#include <vector>

#include "libvio/base/estimate.h"
#include "libvio/io/recording.h"

namespace vio::app {

/// Averages the image's colour at each feature's places.
class Painter {
 public:
    /// Features are forgotten so many images after their last one.
    explicit Painter(long memory_images) : memory_images_(memory_images) {}

    void add(const ImageMessage& image);
    /// The features of an image given before; without one (tracks in place of images): none.
    void add(const FeatureFrame& frame);

    /// Gives the landmarks the colours of their features.
    void paint(std::vector<LandmarkEstimate>& landmarks) const;

 private:
    // Of a feature, summed over its images so far.
    struct Colour {
        Eigen::Vector3f sum = Eigen::Vector3f::Zero();  // blue, green, red
        int count = 0;
        long last_frame = 0;
    };

    long memory_images_, frames_ = 0;

    std::deque<ImageMessage> waiting_;  // for their features
    std::unordered_map<FeatureId, Colour> colours_;
};

}  // namespace vio::app
