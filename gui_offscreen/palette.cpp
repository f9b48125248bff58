#include "gui_offscreen/palette.h"

namespace vio {

using mrpt::img::TColor;

const Palette& palette(bool dark) {
    static const Palette light{
        .background = {255, 255, 255},
        .grid = {186, 192, 202},
        .text = {45, 52, 64},
        .panel = {255, 255, 255},
        .estimate = {24, 90, 219},
        .lost = {214, 39, 40},
        .frustum = {120, 132, 156},
        .gravity = {150, 60, 170},
        .ellipsoid = {96, 150, 245},
        .others = {{{240, 128, 20}, {20, 150, 90}, {200, 50, 130}, {120, 90, 60}}}};
    static const Palette dark_one{
        .background = {19, 22, 28},
        .grid = {66, 73, 85},
        .text = {222, 226, 233},
        .panel = {30, 34, 42},
        .estimate = {80, 160, 255},
        .lost = {255, 85, 85},
        .frustum = {165, 178, 200},
        .gravity = {205, 130, 235},
        .ellipsoid = {120, 180, 255},
        .others = {{{255, 165, 60}, {80, 210, 140}, {245, 110, 180}, {210, 180, 140}}}};
    return dark ? dark_one : light;
}

TColor to_color(const Rgb& rgb) {
    return {rgb[0], rgb[1], rgb[2]};
}

}  // namespace vio
