#include "libvio/io/landmark_colour.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>

#include "libvio/base/median.h"

namespace vio {
namespace {

constexpr Rgb kUnknown = {128, 128, 128};

std::vector<double> distances_of(const std::vector<LandmarkEstimate>& landmarks) {
    std::vector<double> distances;
    for (const LandmarkEstimate& landmark : landmarks) distances.push_back(landmark.p_W.norm());
    return distances;
}

}  // namespace

LandmarkColour natural_colour(const std::vector<LandmarkEstimate>& landmarks) {
    return std::any_of(landmarks.begin(), landmarks.end(),
                       [](const LandmarkEstimate& landmark) { return landmark.rgb.has_value(); })
               ? LandmarkColour::kImage
               : LandmarkColour::kUncertainty;
}

LandmarkColours::LandmarkColours(const std::vector<LandmarkEstimate>& landmarks,
                                 LandmarkColour kind)
    : LandmarkColours(distances_of(landmarks), kind) {}

LandmarkColours::LandmarkColours(std::vector<double> distances, LandmarkColour kind) : kind_(kind) {
    if (distances.empty()) return;
    scale_ = std::max(median(std::move(distances)), 1e-12);
}

Rgb LandmarkColours::rgb(const LandmarkEstimate& landmark) const {
    if (kind_ == LandmarkColour::kImage) return landmark.rgb.value_or(kUnknown);
    const double sigma = std::sqrt(std::max(0.0, landmark.covariance.trace()));
    const double share = std::clamp(sigma / (0.1 * scale_), 0.0, 1.0);
    return {static_cast<std::uint8_t>(40 + 200 * share),
            static_cast<std::uint8_t>(110 * (1 - share) + 40),
            static_cast<std::uint8_t>(240 - 200 * share)};
}

}  // namespace vio
