// Colours of landmarks in files and pictures.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "libvio/base/estimate.h"

namespace vio {

using Rgb = std::array<std::uint8_t, 3>;

/// What a landmark's colour says.
enum class LandmarkColour {
    kImage,       ///< as in the images; grey where not known
    kUncertainty  ///< violet: well known, to yellow-green: badly known
};

/// Image colours where any landmark has one.
LandmarkColour natural_colour(const std::vector<LandmarkEstimate>& landmarks);

/// Root mean square standard deviation over the three axes [m]; 0: not known.
double position_sigma(const LandmarkEstimate& landmark);

/// Standard deviations as shares of a logarithmic scale that spans all but the extreme twentieths.
class UncertaintyScale {
 public:
    /// Of all landmarks [m]; those that are not known (0) do not count.
    explicit UncertaintyScale(std::vector<double> sigmas);

    bool empty() const { return high_ == 0; }
    double low() const { return low_; }    ///< where the share is 0 [m]
    double high() const { return high_; }  ///< where it is 1 [m]
    double share(double sigma) const;

 private:
    double low_ = 0, high_ = 0;
};

/// Colour of a share, well known 0 to badly known 1 (viridis: even steps of brightness, fit for the
/// colour-blind).
Rgb uncertainty_colour(double share, bool on_dark = false);

/// Gives each landmark of an estimate its colour.
class LandmarkColours {
 public:
    LandmarkColours(const std::vector<LandmarkEstimate>& landmarks, LandmarkColour kind);
    /// The same from the landmarks' position_sigma().
    LandmarkColours(std::vector<double> sigmas, LandmarkColour kind);

    Rgb rgb(const LandmarkEstimate& landmark) const;

 private:
    LandmarkColour kind_;
    UncertaintyScale scale_;
};

}  // namespace vio
