// How long parts of the work take.
#pragma once

#include <chrono>

namespace vio {

using SteadyTime = std::chrono::steady_clock::time_point;

inline double seconds_since(SteadyTime began) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
}

/// Runs work and adds the time that it took to seconds.
template <typename Work>
auto timed(double& seconds, Work work) {
    struct Watch {
        double& seconds;
        SteadyTime began = std::chrono::steady_clock::now();
        ~Watch() { seconds += seconds_since(began); }
    } watch{seconds};
    return work();
}

}  // namespace vio
