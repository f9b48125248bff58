// Cost of pictures: a rover's run of 1401 poses and 16,007 landmarks at 1280 x 720.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <random>
#include <string>

#include "gui_offscreen/scene.h"
#include "gui_offscreen/snapshot.h"

namespace vio {
namespace {

Estimate rover_like(int poses, int landmarks) {
    std::mt19937 engine(1);
    std::normal_distribution<double> normal;
    Estimate estimate;
    estimate.g_W = {0, 0, -9.81};
    for (int i = 0; i < poses; ++i) {
        const double a = 6 * M_PI * i / poses;
        StateEstimate state;
        state.t = i * TimeNs{666'000'000};
        state.T_W_B = {so3::exp({0, 0, a}), {12 * std::sin(a), 9 * std::cos(a) + 0.3 * a, 0}};
        state.covariance.setIdentity();
        state.covariance *= 1e-4 * (1 + i);
        estimate.states.push_back(state);
    }
    for (int i = 0; i < landmarks; ++i) {
        LandmarkEstimate landmark;
        landmark.id = i;
        landmark.p_W = {15 * normal(engine), 12 * normal(engine), 0.2 * normal(engine)};
        landmark.covariance =
            (1e-4 + 1e-3 * std::abs(normal(engine))) * Eigen::Matrix3d::Identity();
        estimate.landmarks.push_back(landmark);
    }
    return estimate;
}

double resident_mb() {
    std::ifstream file("/proc/self/statm");
    double total = 0, resident = 0;
    file >> total >> resident;
    return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

// Resident memory at the last picture against that after the tenth shows whether it stays flat.
void snapshot(benchmark::State& state) {
    const auto scene = build_scene(rover_like(1401, 16007));
    SnapshotRenderer renderer(1280, 720);
    if (!renderer.problem().empty()) {
        state.SkipWithError(renderer.problem().c_str());
        return;
    }
    int pictures = 0;
    double warm_mb = 0;
    renderer.render(scene, {});
    for (auto _ : state) {
        benchmark::DoNotOptimize(renderer.render(scene, {}));
        if (++pictures == 10) warm_mb = resident_mb();
    }
    state.counters["MB_after_10"] = warm_mb;
    state.counters["MB_at_end"] = resident_mb();
}

void scene(benchmark::State& state) {
    const Estimate estimate = rover_like(1401, 16007);
    for (auto _ : state) benchmark::DoNotOptimize(build_scene(estimate));
}

BENCHMARK(snapshot)->Unit(benchmark::kMillisecond)->Iterations(30)->UseRealTime();
// Minutes: whether memory stays flat over a long film.
BENCHMARK(snapshot)->Name("film")->Unit(benchmark::kMillisecond)->Iterations(1000)->UseRealTime();
BENCHMARK(scene)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace vio
