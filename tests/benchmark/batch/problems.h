// Batch problems to time solvers on, with a start that is well off the solution.
#pragma once

#include <string>

#include "libvio/batch/model.h"

namespace vio::bench {

struct TimedProblem {
    std::string name;
    BatchOptions options;
    batch::Model model;
    batch::State start;
};

/// Hand-held camera in a room, `frames` images, tracks of bounded length.
TimedProblem room_problem(int frames, int features, int longest_track);

/// Of a scenario file with simulated tracks, along a recorded path if one is given.
TimedProblem scenario_problem(const std::string& ini_file, const std::string& recorded_truth);

/// Images, points, observations and mean track length in one line.
std::string described(const TimedProblem& problem);

}  // namespace vio::bench
