// A picture that shows what a scenario is about.
#pragma once

#include <opencv2/core.hpp>
#include <string>

#include "libvio/simulation/scenario.h"

namespace vio {

/// One strip (8-bit grey, 960 x 240 px): a rendered image from the middle of the motion, the path
/// from above (x to the right, y up) and from the side (x to the right, z up) with a scale bar, the
/// name and what it consists of. The image is drawn whether or not the scenario renders.
cv::Mat contact_strip(const Simulation& simulation);

}  // namespace vio
