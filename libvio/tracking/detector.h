// New features, spread over the image.
#pragma once

#include <Eigen/Dense>
#include <opencv2/core.hpp>
#include <vector>

namespace vio {

struct DetectorOptions {
    double min_distance_px = 15;  ///< between features
    double border_px = 10;        ///< kept free along the image's edges
    double quality = 0.01;        ///< weakest corner, as a share of the strongest [-]
};

/// Up to `wanted` corners (Shi and Tomasi's, to sub-pixel), strongest first, that keep their
/// distance from `existing` and from each other and lie where the mask (8-bit, empty for none) is
/// not zero. Cells of a grid of `max_features` cells that hold no feature are served first.
/// image: 8-bit grey; half: the same at half size (each pixel the mean around 2x, 2y).
std::vector<Eigen::Vector2d> detect_features(const cv::Mat& image, const cv::Mat& half,
                                             const std::vector<Eigen::Vector2d>& existing,
                                             const cv::Mat& mask, int wanted, int max_features,
                                             const DetectorOptions& options);

}  // namespace vio
