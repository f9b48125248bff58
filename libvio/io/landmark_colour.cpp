#include "libvio/io/landmark_colour.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>

namespace vio {
namespace {

constexpr Rgb kUnknown = {128, 128, 128};

std::vector<double> sigmas_of(const std::vector<LandmarkEstimate>& landmarks) {
    std::vector<double> sigmas;
    for (const LandmarkEstimate& landmark : landmarks) sigmas.push_back(position_sigma(landmark));
    return sigmas;
}

}  // namespace

LandmarkColour natural_colour(const std::vector<LandmarkEstimate>& landmarks) {
    return std::any_of(landmarks.begin(), landmarks.end(),
                       [](const LandmarkEstimate& landmark) { return landmark.rgb.has_value(); })
               ? LandmarkColour::kImage
               : LandmarkColour::kUncertainty;
}

double position_sigma(const LandmarkEstimate& landmark) {
    const double variance = landmark.covariance.trace() / 3;
    return landmark.p_W.allFinite() && std::isfinite(variance) && variance > 0 ? std::sqrt(variance)
                                                                               : 0;
}

UncertaintyScale::UncertaintyScale(std::vector<double> sigmas) {
    std::erase(sigmas, 0.);
    if (sigmas.empty()) return;
    std::sort(sigmas.begin(), sigmas.end());
    low_ = sigmas[sigmas.size() / 20];
    high_ = std::max(sigmas[sigmas.size() - 1 - sigmas.size() / 20], 1.0001 * low_);
}

double UncertaintyScale::share(double sigma) const {
    return std::log(sigma / low_) / std::log(high_ / low_);
}

Rgb uncertainty_colour(double share, bool on_dark) {
    // On white the bright end of viridis would vanish, on dark its dark end: each is cut off.
    static constexpr std::array<Rgb, 6> kStops = {{{68, 1, 84},
                                                   {65, 68, 135},
                                                   {42, 120, 142},
                                                   {34, 168, 132},
                                                   {122, 209, 81},
                                                   {253, 231, 37}}};
    const double x = std::clamp(share, 0.0, 1.0);
    const double place = on_dark ? 1.4 + 3.6 * x : 4.2 * x;
    const size_t i = std::min<size_t>(static_cast<size_t>(place), kStops.size() - 2);
    const double u = place - static_cast<double>(i);
    Rgb mixed;
    for (size_t k = 0; k < 3; ++k)
        mixed[k] =
            static_cast<std::uint8_t>(std::lround((1 - u) * kStops[i][k] + u * kStops[i + 1][k]));
    return mixed;
}

LandmarkColours::LandmarkColours(const std::vector<LandmarkEstimate>& landmarks,
                                 LandmarkColour kind)
    : LandmarkColours(sigmas_of(landmarks), kind) {}

LandmarkColours::LandmarkColours(std::vector<double> sigmas, LandmarkColour kind)
    : kind_(kind), scale_(std::move(sigmas)) {}

Rgb LandmarkColours::rgb(const LandmarkEstimate& landmark) const {
    if (kind_ == LandmarkColour::kImage) return landmark.rgb.value_or(kUnknown);
    const double sigma = position_sigma(landmark);
    return sigma > 0 ? uncertainty_colour(scale_.share(sigma)) : kUnknown;
}

}  // namespace vio
