// Time to draw an image through each camera model, and how well Lucas-Kanade's optical flow between
// images agrees with the true projections (counter lk_px: median distance; bar: 0.15).
#include <benchmark/benchmark.h>

#include "tests/optical_flow.h"

namespace {

void draw(benchmark::State& state, const vio::test::FlowCase& flow_case) {
    const vio::Simulation simulation(flow_case.options);
    benchmark::DoNotOptimize(simulation.image(0));  // textures and rays
    std::vector<double> errors;
    int i = 0;
    for (auto _ : state) benchmark::DoNotOptimize(simulation.image(i++ % 60));
    for (int k = 2; k < 58; k += 8)
        for (const double error : vio::test::flow_errors(simulation, k, 11))
            errors.push_back(error);
    state.counters["lk_px"] = vio::median(errors);
    state.counters["corners"] = static_cast<double>(errors.size());
}

const bool registered = [] {
    for (const auto& flow_case : vio::test::flow_cases())
        benchmark::RegisterBenchmark(("draw " + flow_case.name).c_str(), draw, flow_case)
            ->Unit(benchmark::kMillisecond)
            ->UseRealTime();
    return true;
}();

}  // namespace
