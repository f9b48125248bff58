#include "tests/benchmark/batch/problems.h"

#include <cstdio>
#include <filesystem>
#include <random>

#include "libvio/batch/start.h"
#include "libvio/simulation/scenario.h"
#include "tests/simulated_batch.h"

namespace vio::bench {
namespace {

// Statistical weights, squared loss: the same cost for every solver.
BatchOptions plain_options() {
    BatchOptions options;
    options.loss = "none";
    options.outlier_sigmas = 0;
    return options;
}

// The truth with errors of 1 degree, 5 cm, 0.1 m/s, a twentieth of the distance of each point, and
// without the biases.
void disturb(TimedProblem& problem) {
    std::mt19937 engine(4);
    std::normal_distribution<double> normal;
    const auto noise = [&](double sigma) {
        return Eigen::Vector3d(sigma * normal(engine), sigma * normal(engine),
                               sigma * normal(engine));
    };
    batch::State& state = problem.start;
    for (size_t j = 0; j < state.points.size(); ++j) {
        const batch::Observation& first =
            problem.model.observations[problem.model.points[j].first_observation];
        const Eigen::Vector3d eye = state.frames[first.frame_idx].motion.p;
        state.points[j] = eye + (1 + 0.05 * normal(engine)) * (state.points[j] - eye);
    }
    for (size_t i = 0; i < state.frames.size(); ++i) {
        batch::State::Frame& frame = state.frames[i];
        frame.bias = {};
        frame.motion.v += noise(0.1);
        if (i == 0) continue;  // the gauge
        frame.motion.R = so3::normalized(frame.motion.R * so3::exp(noise(0.02)));
        frame.motion.p += noise(0.05);
    }
    state.gravity = so3::exp(noise(0.02)) * state.gravity;
}

TimedProblem make_problem(std::string name, const BatchProblem& problem, const Estimate& truth,
                          BatchOptions options) {
    TimedProblem timed{std::move(name), options, {}, {}};
    timed.model =
        batch::make_model(problem, timed.options, static_cast<int>(problem.frames.size()));
    timed.start = batch::given_start(timed.model, truth);
    disturb(timed);
    return timed;
}

}  // namespace

TimedProblem room_problem(int frames, int features, int longest_track) {
    test::SimulatedRunOptions simulation;
    simulation.seconds = frames / simulation.image_hz + 1e-6;
    simulation.features = features;
    simulation.longest_track = longest_track;
    const auto run = simulate_run(simulation);
    return make_problem("room, " + std::to_string(frames) + " images", test::batch_problem(run),
                        test::truth_from(run, run.truth.front().T_W_B), plain_options());
}

TimedProblem scenario_problem(const std::string& ini_file) {
    ScenarioOptions scenario = ScenarioOptions::from_file(ini_file);
    scenario.tracks = true;
    const Simulation simulation(scenario);
    BatchProblem problem;
    problem.rig = simulation.rig();
    problem.frames = simulation.tracks().frames;
    problem.imu = ImuSequence(simulation.imu());
    Estimate truth;
    truth.states = simulation.truth();
    truth.g_W = simulation.g_W();
    for (const auto& [id, point] : simulation.tracks().points_W) {
        LandmarkEstimate landmark;
        landmark.id = id;
        landmark.p_W = point;
        truth.landmarks.push_back(landmark);
    }
    BatchOptions options = plain_options();
    options.sigma_px = scenario.track_model.noise_px;
    return make_problem(std::filesystem::path(ini_file).stem().string(), problem, truth, options);
}

std::string described(const TimedProblem& problem) {
    char text[200];
    std::snprintf(
        text, sizeof text,
        "%s: %d images, %zu points, %zu observations (%.1f a track, %.1f an image)",
        problem.name.c_str(), problem.model.frames(), problem.model.points.size(),
        problem.model.observations.size(),
        1.0 * static_cast<double>(problem.model.observations.size()) /
            static_cast<double>(problem.model.points.size()),
        1.0 * static_cast<double>(problem.model.observations.size()) / problem.model.frames());
    return text;
}

}  // namespace vio::bench
