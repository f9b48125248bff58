// Plots, drawn by gnuplot.
#pragma once

#include <string>
#include <vector>

namespace vio::app {

/// One curve of a plot, in data units.
struct Series {
    enum Style { kLine, kDashed, kPoints, kSquares, kLinePoints, kBand };
    std::string name;  ///< for the key; empty: not in it
    int colour = 1;    ///< 1 blue, 2 orange, 3 green, 4 magenta, 5 grey, 6 red
    Style style = kLine;
    std::vector<double> x, y;  ///< a value that is not finite breaks the line
    std::vector<double> y2;    ///< kBand: upper edge, y being the lower one
};

/// Curves over common axes; labels name the units, sizes are in pixels.
struct Plot {
    std::string title, x_label, y_label;
    bool equal_axes = false;  ///< one metre is as long in x as in y
    bool log_x = false, log_y = false;
    bool whole_x = false;  ///< x ticks at whole numbers
    int width = 640, height = 300;
    std::vector<Series> series;
};

/// Draws each plot as an SVG text that takes its colours from the page's theme: CSS variables
/// --c1...--c6, --ink and --rule (see theme_css). Throws InputError, which says what to install,
/// where gnuplot is missing.
std::vector<std::string> draw(const std::vector<Plot>& plots);

/// CSS that sets the plots' colours, for light and dark pages.
std::string theme_css();

/// A plot as a file of its own, with the theme inside.
std::string standalone(const std::string& svg);

}  // namespace vio::app
