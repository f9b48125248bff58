// The order in which a recording program would have written a simulation's messages.
#pragma once

#include <vector>

#include "libvio/base/options.h"
#include "libvio/base/types.h"
#include "libvio/simulation/random.h"

namespace vio {

/// What goes wrong between the sensors and the file.
struct StreamModel {
    double image_drop_rate = 0, imu_drop_rate = 0;  ///< share of the messages that are lost [-]
    int longest_drop = 1;       ///< messages lost in a row: 1 to this many, evenly
    double duplicate_rate = 0;  ///< share of the messages that are written twice [-]

    void describe(OptionSet& options);
};

/// A message of the simulation: the index in the list of its kind.
struct StreamEntry {
    enum class Kind { kImu, kOdometry, kGps, kImage };  ///< in order of writing at equal stamps
    TimeNs t = 0;
    Kind kind = Kind::kImu;
    int index = 0;
};

/// Sorts by time, then drops images and readings and repeats messages of any kind.
std::vector<StreamEntry> arranged(std::vector<StreamEntry> entries, const StreamModel& model,
                                  Random& random);

}  // namespace vio
