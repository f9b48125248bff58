// The time stamps of one stream: rate, gaps, jitter, order.
#pragma once

#include <vector>

#include "libvio/base/types.h"
#include "libvio/check/finding.h"

namespace vio {

/// Intervals are those between neighbours in order of time, after repeated stamps are left out.
struct StampStatistics {
    int count = 0;               ///< stamps, repeated ones included
    TimeNs first = 0, last = 0;  ///< smallest and largest
    TimeNs median_interval = 0;
    double jitter = 0;  ///< rms deviation from the median of the intervals that are no gaps [s]
    int gaps = 0;       ///< intervals of more than kGap times the median
    int missing = 0;    ///< stamps that would fill the gaps
    TimeNs largest_gap = 0;     ///< longest interval, whether or not it counts as a gap
    TimeNs largest_gap_at = 0;  ///< stamp before it
    int repeated = 0;           ///< stamps that occurred before
    int backward = 0;           ///< stamps before their predecessor in the file
    TimeNs largest_step_back = 0;

    static constexpr double kGap = 1.6;

    double rate() const {  ///< [Hz], 0 for fewer than two stamps
        return median_interval > 0 ? 1 / to_seconds(median_interval) : 0;
    }
    double duration() const { return to_seconds(last - first); }  ///< [s]
};

/// stamps: in order of the file.
StampStatistics stamp_statistics(const std::vector<TimeNs>& stamps);

/// Verdicts on the readings' and the images' stamps.
std::vector<Finding> check_imu_stamps(const StampStatistics& imu);
std::vector<Finding> check_image_stamps(const StampStatistics& images);
/// Whether the readings, on the IMU's clock, cover the images; time_offset as in Rig.
Finding check_overlap(const StampStatistics& imu, const StampStatistics& images,
                      double time_offset);

}  // namespace vio
