// Where an estimator expects a feature in an image to come.
#pragma once

#include <Eigen/Dense>

#include "libvio/base/types.h"

namespace vio {

/// A feature's expected pixel, with the uncertainty of the expectation.
struct PredictedFeature {
    FeatureId id = -1;
    Eigen::Vector2d uv_px;
    Eigen::Matrix2d covariance;  ///< of uv_px, without the measurement's noise [px^2]
};

}  // namespace vio
