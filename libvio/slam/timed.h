// How long parts of the work take.
#pragma once

#include <chrono>

namespace vio {

/// Runs work and adds the time that it took to seconds.
template <typename Work>
auto timed(double& seconds, Work work) {
    struct Watch {
        double& seconds;
        std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
        ~Watch() {
            seconds +=
                std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        }
    } watch{seconds};
    return work();
}

}  // namespace vio
