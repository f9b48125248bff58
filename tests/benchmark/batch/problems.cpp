#include "tests/benchmark/batch/problems.h"

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <random>

#include "libvio/batch/start.h"
#include "tests/scenario_batch.h"

namespace vio::bench {
namespace {

// Statistical weights, squared loss: the same cost for every solver.
BatchOptions plain_options() {
    BatchOptions options;
    options.loss = "none";
    options.outlier_sigmas = 0;
    return options;
}

// The truth with errors as a filter leaves them: poses off by up to 2 degrees and 10 cm, slowly
// varying; velocities by 0.1 m/s; points by these and by a twentieth of their distance; no biases.
void disturb(TimedProblem& problem) {
    std::mt19937 engine(4);
    std::normal_distribution<double> normal;
    const auto noise = [&](double sigma) {
        return Eigen::Vector3d(sigma * normal(engine), sigma * normal(engine),
                               sigma * normal(engine));
    };
    batch::State& state = problem.start;
    const std::vector<batch::State::Frame> truth = state.frames;
    const Eigen::Vector3d turn = noise(0.02), shift = noise(0.06);
    constexpr double kPeriod = 300;  // images
    for (size_t i = 0; i < state.frames.size(); ++i) {
        batch::State::Frame& frame = state.frames[i];
        frame.bias = {};
        frame.motion.v += noise(0.1);
        const double phase = 2 * M_PI * static_cast<double>(i) / kPeriod;  // zero at the gauge
        frame.motion.R = so3::normalized(frame.motion.R * so3::exp(std::sin(phase) * turn));
        frame.motion.p += std::sin(1.3 * phase) * shift;
    }
    const Eigen::Vector3d camera = problem.model.T_I_C.p;
    for (size_t j = 0; j < state.points.size(); ++j) {
        const int i =
            problem.model.observations[problem.model.points[j].first_observation].frame_idx;
        const InertialState &from = truth[i].motion, &to = state.frames[i].motion;
        const Eigen::Vector3d p_I = from.R.transpose() * (state.points[j] - from.p);
        state.points[j] = to.R * (camera + (1 + 0.05 * normal(engine)) * (p_I - camera)) + to.p;
    }
    state.gravity = so3::exp(noise(0.01)) * state.gravity;
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

TimedProblem scenario_problem(const std::string& ini_file, const std::string& recorded_truth) {
    ScenarioOptions scenario = ScenarioOptions::from_file(ini_file);
    if (!recorded_truth.empty() && !scenario.recorded_file.empty())
        scenario.recorded_file = recorded_truth;
    const test::ScenarioRun run = test::run_scenario(scenario);
    BatchOptions options = plain_options();
    options.sigma_px = run.sigma_px;
    return make_problem(std::filesystem::path(ini_file).stem().string(), run.problem, run.truth,
                        options);
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
