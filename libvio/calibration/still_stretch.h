// The part of a recording in which an IMU lay still.
#pragma once

#include <string>
#include <vector>

#include "libvio/base/types.h"

namespace vio {

/// A stretch of readings.
struct StillStretch {
    std::ptrdiff_t begin = 0, end = 0;  ///< indices of readings, end not included
    std::vector<std::string> warnings;  ///< what else there was: motion, gaps
};

/// The longest stretch without motion (see estimate_imu_noise) and without a gap of more than three
/// intervals. Throws InputError (the reason only) where none is at least 60 s long.
StillStretch longest_still_stretch(const std::vector<ImuReading>& readings);

}  // namespace vio
