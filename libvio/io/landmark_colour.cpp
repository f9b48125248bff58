#include "libvio/io/landmark_colour.h"

#include <algorithm>
#include <cmath>

namespace vio {

namespace {

std::vector<double> distances_of(const std::vector<LandmarkEstimate>& landmarks) {
    std::vector<double> distances;
    for (const LandmarkEstimate& landmark : landmarks) distances.push_back(landmark.p_W.norm());
    return distances;
}

}  // namespace

LandmarkColours::LandmarkColours(const std::vector<LandmarkEstimate>& landmarks)
    : LandmarkColours(distances_of(landmarks)) {}

LandmarkColours::LandmarkColours(std::vector<double> distances) {
    if (distances.empty()) return;
    const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
    std::nth_element(distances.begin(), middle, distances.end());
    scale_ = std::max(*middle, 1e-12);
}

Eigen::Vector3i LandmarkColours::rgb(const LandmarkEstimate& landmark) const {
    const double sigma = std::sqrt(std::max(0.0, landmark.covariance.trace()));
    const double share = std::clamp(sigma / (0.1 * scale_), 0.0, 1.0);
    return {static_cast<int>(40 + 200 * share), static_cast<int>(110 * (1 - share) + 40),
            static_cast<int>(240 - 200 * share)};
}

}  // namespace vio
