#include "gui_offscreen/palette.h"

#include <algorithm>
#include <array>
#include <cmath>

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

TColor uncertainty_color(double share, bool dark) {
    // On white the bright end of viridis would vanish, on dark its dark end: each is cut off.
    struct Rgb {
        double r, g, b;
    };
    static constexpr std::array<Rgb, 6> kStops = {{{68, 1, 84},
                                                   {65, 68, 135},
                                                   {42, 120, 142},
                                                   {34, 168, 132},
                                                   {122, 209, 81},
                                                   {253, 231, 37}}};
    const double x = std::clamp(share, 0.0, 1.0);
    const double place = dark ? 1.4 + 3.6 * x : 4.2 * x;
    const int i = std::min(static_cast<int>(place), 4);
    const double u = place - i;
    const Rgb &a = kStops[static_cast<size_t>(i)], &b = kStops[static_cast<size_t>(i) + 1];
    const auto mix = [u](double p, double q) {
        return static_cast<uint8_t>(std::lround(p + u * (q - p)));
    };
    return {mix(a.r, b.r), mix(a.g, b.g), mix(a.b, b.b)};
}

}  // namespace vio
