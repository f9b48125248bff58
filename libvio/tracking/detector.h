// New features, spread over the image.
#pragma once

#include <Eigen/Dense>
#include <opencv2/core.hpp>
#include <vector>

namespace vio {

/// How far apart and how strong new features are.
struct DetectorOptions {
    double min_distance_px = 15;  ///< between features
    double border_px = 10;        ///< kept free along the image's edges
    double quality = 0.01;        ///< weakest corner, as a share of the strongest [-]
};

/// Up to `wanted` corners (Shi and Tomasi's), strongest first, that keep their
/// distance from `existing` and from each other and lie where the mask (8-bit, empty for none) is
/// not zero. Cells of a grid of `max_features` cells that hold no feature are served first.
/// half: the image at half size, 8-bit grey (each pixel the mean around 2x, 2y). Places are given
/// in the image, to two pixels: the place of first sight defines the feature, and moving it to the
/// corner's sub-pixel centre made tracks neither longer nor more exact.
std::vector<Eigen::Vector2d> detect_features(const cv::Mat& half,
                                             const std::vector<Eigen::Vector2d>& existing,
                                             const cv::Mat& mask, int wanted, int max_features,
                                             const DetectorOptions& options);

}  // namespace vio
