// Batch problems made from scenario files.
#pragma once

#include "libvio/simulation/scenario.h"
#include "tests/simulated_batch.h"

namespace vio::test {

struct ScenarioRun {
    BatchProblem problem;
    Estimate truth;  ///< in the scenario's frame, with landmarks
    double sigma_px = 1;
};

/// The first `images` of a scenario with feature tracks (0: all).
inline ScenarioRun run_scenario(ScenarioOptions options, int images = 0) {
    options.tracks = true;
    options.render = false;
    if (images > 0) options.image_count = images;
    const Simulation simulation(options);
    ScenarioRun run;
    run.sigma_px = options.track_model.noise_px;
    run.problem.rig = simulation.rig();
    run.problem.frames = simulation.tracks().frames;
    run.problem.imu = ImuSequence(simulation.imu());
    run.truth.g_W = simulation.g_W();
    run.truth.states = simulation.truth();
    for (const auto& [id, point] : simulation.tracks().points_W) {
        LandmarkEstimate landmark;
        landmark.id = id;
        landmark.p_W = point;
        run.truth.landmarks.push_back(landmark);
    }
    return run;
}

}  // namespace vio::test
