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

    /// An interruption, from a time after the first image on.
    struct Fault {
        double from = 0, length = 0;  ///< [s]; length 0: none
        bool holds(TimeNs t, TimeNs first_image) const {
            const double seconds = to_seconds(t - first_image);
            return length > 0 && seconds >= from && seconds < from + length;
        }
    };
    Fault no_images, no_readings;
    Fault dark;  ///< a cap on the lens: images are black, features lost

    void describe(OptionSet& options);
};

/// A message of the simulation: the index in the list of its kind.
struct StreamEntry {
    enum class Kind { kImu, kOdometry, kGps, kImage };  ///< in order of writing at equal stamps
    TimeNs t = 0;
    Kind kind = Kind::kImu;
    int index = 0;
};

/// Sorts by time, leaves out what the faults interrupt, then drops images and readings and repeats
/// messages of any kind.
std::vector<StreamEntry> arranged(std::vector<StreamEntry> entries, const StreamModel& model,
                                  Random& random);

}  // namespace vio
