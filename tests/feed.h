// Measurements of a simulation to the recursive estimator.
#pragma once

#include <vector>

#include "libvio/recursive/iekf.h"
#include "libvio/simulation/scenario.h"

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

/// The same in the order in which a recording would hold the messages, with what it would lack.
inline void feed(Iekf& filter, const Simulation& simulation) {
    for (const StreamEntry& entry : simulation.stream()) {
        if (entry.kind == StreamEntry::Kind::kImu)
            filter.add(simulation.imu()[static_cast<std::size_t>(entry.index)]);
        if (entry.kind == StreamEntry::Kind::kImage)
            filter.add(simulation.tracks().frames[static_cast<std::size_t>(entry.index)]);
    }
}

}  // namespace vio::test
