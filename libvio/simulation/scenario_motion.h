// The motion of a scenario's vehicle, unless it follows a recorded path.
#pragma once

#include <cstdint>
#include <string>

#include "libvio/base/options.h"
#include "libvio/simulation/trajectory.h"

namespace vio {

/// Keys of a scenario's section [trajectory]. Lists are text, numbers separated by blanks.
struct ScenarioMotion {
    std::string path = "curve";
    std::string waypoints = "0 0 0 1.2 0 0 0, 1 1 0 1.2 0 0 0";
    bool at_rest = true;
    std::string route = "0 0, 10 0";
    double duration_s = 60, stop_duration_s = 5;
    int stops = 0;
    double ramp_s = 1;
    double roughness_angle_deg = 0, roughness_height = 0, roughness_length = 2;
    double shake_angle_deg = 0, shake_distance = 0, shake_rate = 1;

    void describe(OptionSet& options);
    /// Then the vehicle may be taken to rest before and after the motion.
    bool rests_at_ends() const { return at_rest || path != "curve"; }
    /// Throws InputError where a value makes no sense.
    SplineTrajectory make(std::uint64_t seed) const;
};

}  // namespace vio
