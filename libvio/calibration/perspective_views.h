// What a camera of any model sees, as perspective images.
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "libvio/camera/camera.h"

namespace vio {

/// Perspective views in directions that together cover all that a camera sees, each sharing a wide
/// margin with its neighbours, drawn from the camera's images. Straight lines are straight in them,
/// and nothing is mirrored. Views of far points: of a camera without a single viewpoint, what is
/// near is bent a little.
class PerspectiveViews {
 public:
    explicit PerspectiveViews(CameraPtr camera);

    int count() const { return static_cast<int>(views_.size()); }
    /// View k of an image of the camera's size; grey where the camera sees nothing.
    cv::Mat draw(int k, const cv::Mat& image) const;
    /// Place in the camera's image of a place in view k; nothing where the camera does not see it.
    std::optional<cv::Point2f> in_image(int k, const cv::Point2f& in_view) const;

 private:
    // A perspective image of part of what the camera sees.
    struct View {
        Eigen::Matrix3d R_C_V;  ///< z along the view's middle
        cv::Mat map_x, map_y;   ///< place in the image of each pixel; outside: not seen
    };

    void compute_map(int k);

    CameraPtr camera_;
    double focal_length_px_;
    int size_px_;
    std::vector<View> views_;
};

}  // namespace vio
