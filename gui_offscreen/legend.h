// What the colours of a picture mean, written on it.
#pragma once

#include <mrpt/opengl/COpenGLScene.h>

#include <opencv2/core.hpp>

namespace vio {

/// Draws a panel with a row for each path and what else the scene names (landmarks with their scale
/// of colours, ellipsoids, gravity, grid), and, where pixels_per_metre is positive, a scale bar.
/// `size` scales text and marks: 1 suits a picture 720 px high.
void draw_legend(cv::Mat& picture, const mrpt::opengl::COpenGLScene& scene, double size,
                 double pixels_per_metre = 0);

}  // namespace vio
