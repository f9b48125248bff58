// Which features are points of one rigid scene, over some thirty images.
#pragma once

#include <deque>
#include <map>
#include <optional>
#include <vector>

#include "libvio/geometry/pose.h"
#include "libvio/tracking/view_history.h"

namespace vio {

/// How long the window is, and what fits.
struct RigidWindowOptions {
    int images = 30;       ///< that the window spans while the camera moves; under 4 strides: off
    int stride = 2;        ///< images between those that are used
    double threshold = 0;  ///< largest angular error of a good feature [rad]
};

/// What two images cannot show: a feature that slides along its epipolar line fits every pair of
/// images but no single point in space. The apparent crossing of a near edge and a far one is of
/// that kind, or so near to it that pairs of images do not tell. Every `stride` images, the poses
/// of the window's images and the features' places are estimated from the images alone (bundle
/// adjustment with a robust cost, up to a similarity), and the features that do not fit are named.
/// Source: the verification by geometry over a short sequence that section 10.2 of the paper
/// describes.
///
/// While the camera stands still its images count as one: many from one place would say that it is
/// exact, and push out those from other places, without which nothing has depth.
///
/// Rays are taken as if from one viewpoint, as in estimate_two_view.
class RigidWindow {
 public:
    explicit RigidWindow(const RigidWindowOptions& options) : options_(options) {}

    /// Adds an image. R_C1_C2: the camera's rotation since the previous image; without it the
    /// window begins anew. Returns the features that are no points of the rigid scene; nothing
    /// where the window cannot tell (fewer than four of its images, or most features disagree).
    std::vector<FeatureId> check(const std::vector<FeatureRay>& rays,
                                 const std::optional<Eigen::Matrix3d>& R_C1_C2);

    /// Keeps that image's features (those found in it included) for later checks.
    void remember(const std::vector<FeatureRay>& rays);

    /// Poses of the window's images, oldest first, in the frame of the oldest, the farthest at
    /// distance one. Empty before there are any.
    std::vector<Pose> poses() const;

 private:
    // An image of the window: its pose up to scale, unit rays in the camera frame.
    struct View {
        Pose T_W_C;
        std::map<FeatureId, Eigen::Vector3d> rays;
    };
    bool stands() const;
    bool start();
    std::vector<FeatureId> judge();
    static std::map<FeatureId, Eigen::Vector3d> by_id(const std::vector<FeatureRay>& rays);

    RigidWindowOptions options_;
    std::deque<View> views_;
    bool started_ = false;  // views_ have poses
    int since_view_ = 0;    // images; 0: the newest image is the last of views_
    Eigen::Matrix3d R_since_view_ = Eigen::Matrix3d::Identity();
};

}  // namespace vio
