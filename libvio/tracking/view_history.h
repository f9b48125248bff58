// Rays of the latest images, and the check of new ones against them.
#pragma once

#include <deque>
#include <map>
#include <optional>
#include <vector>

#include "libvio/base/types.h"
#include "libvio/tracking/two_view.h"

namespace vio {

/// A feature's direction in the newest image.
struct FeatureRay {
    FeatureId id = -1;
    Eigen::Vector3d f;  ///< unit vector in the camera frame
};

/// What the other features say about one.
enum class Verdict : char { unchecked, agrees, disagrees };

/// Remembers where features were seen, and checks later sights of them for one rigid motion.
class ViewHistory {
 public:
    /// length: images that are kept; threshold: largest angular error of a good feature [rad].
    ViewHistory(int length, double threshold, unsigned long long seed)
        : length_(length), threshold_(threshold), seed_(seed) {}

    /// Checks the features of a new image against those 1, 2, 4, 8.. images back, as far as they
    /// are kept: the further, the more have slow errors added up. A feature that disagrees once
    /// takes no part in the further checks; one that none of these images has is unchecked. R is
    /// the camera's rotation since the previous image where known, and becomes the one that the
    /// features themselves give.
    std::vector<Verdict> check(const std::vector<FeatureRay>& rays,
                               std::optional<Eigen::Matrix3d>& R);

    /// Keeps the new image's features (those found in it included) for later checks.
    void remember(const std::vector<FeatureRay>& rays);

    /// Pairs in agreement between the previous image and the new one.
    int inliers() const { return inliers_; }

 private:
    // An image: unit rays in the camera frame.
    struct View {
        std::map<FeatureId, Eigen::Vector3d> rays;
        std::optional<Eigen::Matrix3d> R_next;  ///< rotation from this image to the next
    };
    std::optional<TwoViewMotion> check_against(const View& view,
                                               const std::vector<FeatureRay>& rays,
                                               const std::optional<Eigen::Matrix3d>& R,
                                               std::vector<Verdict>& verdicts) const;

    int length_;
    double threshold_;
    unsigned long long seed_;
    std::deque<View> views_;  // newest last
    int inliers_ = 0;
};

}  // namespace vio
