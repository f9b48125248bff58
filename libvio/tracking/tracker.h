// Feature tracks from images.
#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <optional>

#include "libvio/base/options.h"
#include "libvio/base/types.h"
#include "libvio/camera/camera.h"

namespace vio {

struct TrackerOptions {
    int max_features = 150;

    void describe(OptionSet& options);
};

/// Follows features through a sequence of grey images of one camera.
class FeatureTracker {
   public:
    FeatureTracker(const TrackerOptions& options, CameraPtr camera);
    ~FeatureTracker();

    /// Features of the next image (8-bit grey, size of the camera). R_C1_C2 is the rotation of the
    /// camera since the previous image (p_C1 = R_C1_C2 p_C2 for far points), from the gyro, where
    /// known; it predicts where features have moved.
    FeatureFrame track(TimeNs t, const cv::Mat& image,
                       const std::optional<Eigen::Matrix3d>& R_C1_C2 = std::nullopt);

   private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace vio
