// One feature that is followed through the images.
#pragma once

#include <Eigen/Dense>
#include <memory>
#include <optional>

#include "libvio/base/types.h"
#include "libvio/tracking/patch.h"

namespace vio {

/// Where a feature is expected in a new image, and its shape there.
struct Expectation {
    Eigen::Vector2d uv = Eigen::Vector2d::Zero();
    Eigen::Matrix2d A = Eigen::Matrix2d::Identity();
    Eigen::Vector2d uv_far = Eigen::Vector2d::Zero();  ///< as rotation alone moves it
    std::optional<Eigen::Matrix2d> region = {};  ///< covariance of uv where an estimator told it
};

/// A feature's place in the newest image and its history; pixels, and rays in the camera frame.
struct Track {
    FeatureId id = -1;
    Eigen::Vector2d uv;           ///< in the newest image, expected if missed > 0
    Eigen::Vector3d f;            ///< direction of its ray in the camera frame
    Eigen::Matrix2d A;            ///< shape relative to the look
    std::unique_ptr<Patch> look;  ///< first appearance, or one renewed since
    bool seen = true;             ///< in the newest image
    int missed = 0;               ///< images since it was last seen
    std::optional<Eigen::Vector2d> parallax =
        {};                     ///< last motion beyond that of the far scene [px/s]
    Expectation expected = {};  ///< in the newest image
};

}  // namespace vio
