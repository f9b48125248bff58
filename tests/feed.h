// Measurements of a simulation to the recursive estimator.
#pragma once

#include <vector>

#include "libvio/recursive/iekf.h"

namespace vio::test {

/// Hands measurements to the filter in order of time; an image as soon as readings reach it.
inline void feed(Iekf& filter, const std::vector<ImuReading>& readings,
                 const std::vector<FeatureFrame>& frames, double time_offset = 0,
                 std::size_t first_frame = 0) {
    const TimeNs offset = from_seconds(time_offset);
    std::size_t next = first_frame;
    for (const ImuReading& reading : readings) {
        while (next < frames.size() && frames[next].t + offset <= reading.t)
            filter.add(frames[next++]);
        filter.add(reading);
    }
    while (next < frames.size()) filter.add(frames[next++]);
}

}  // namespace vio::test
