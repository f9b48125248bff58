// Colours of landmarks in files.
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
    kUncertainty  ///< blue: well known, red: a tenth of the median distance or worse
};

/// Image colours where any landmark has one.
LandmarkColour natural_colour(const std::vector<LandmarkEstimate>& landmarks);

/// Gives each landmark of an estimate its colour.
class LandmarkColours {
 public:
    LandmarkColours(const std::vector<LandmarkEstimate>& landmarks, LandmarkColour kind);
    /// The same from the distances of the landmarks from W's origin [m].
    LandmarkColours(std::vector<double> distances, LandmarkColour kind);

    LandmarkColour kind() const { return kind_; }
    Rgb rgb(const LandmarkEstimate& landmark) const;

 private:
    LandmarkColour kind_;
    double scale_ = 1;  ///< median distance [m]
};

}  // namespace vio
