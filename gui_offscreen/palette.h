// The colours of scenes and pictures.
#pragma once

#include <mrpt/img/TColor.h>

#include <array>

namespace vio {

/// What each part of a picture is drawn in, on light or dark ground.
struct Palette {
    mrpt::img::TColor background, grid, text, panel, estimate, lost, frustum, gravity, ellipsoid;
    std::array<mrpt::img::TColor, 4> others;  ///< truth first
};

const Palette& palette(bool dark);

/// Colour of a standard deviation: certain 0 to uncertain 1 (viridis and its like: even steps of
/// brightness, fit for the colour-blind).
mrpt::img::TColor uncertainty_color(double share, bool dark);

}  // namespace vio
