// The colours of scenes and pictures.
#pragma once

#include <mrpt/img/TColor.h>

#include <array>

#include "libvio/io/landmark_colour.h"

namespace vio {

/// What each part of a picture is drawn in, on light or dark ground.
struct Palette {
    mrpt::img::TColor background, grid, text, panel, estimate, lost, frustum, gravity, ellipsoid;
    std::array<mrpt::img::TColor, 4> others;  ///< truth first
};

const Palette& palette(bool dark);

mrpt::img::TColor to_color(const Rgb& rgb);

}  // namespace vio
