// Cost of the recursive estimator alone, over the number of features: per image and per reading.
#include <benchmark/benchmark.h>

#include <chrono>

#include "libvio/recursive/iekf.h"
#include "tests/simulated_run.h"

namespace vio {
namespace {

void iekf(benchmark::State& state) {
    test::SimulatedRunOptions simulated;
    simulated.seconds = 8;
    simulated.features = static_cast<int>(state.range(0));
    const test::SimulatedRun run = test::simulate_run(simulated);
    IekfOptions options;
    options.message_window = 0;  // each message is worked on when it is added
    double image_seconds = 0, reading_seconds = 0;
    std::size_t images = 0, readings = 0;
    for (auto _ : state) {
        Iekf filter(run.rig, options, {});
        filter.start(test::sampled_start(run, 5, 1));
        std::size_t next = 5;
        for (const ImuReading& reading : run.readings) {
            const bool image = next < run.frames.size() && run.frames[next].t <= reading.t;
            while (next < run.frames.size() && run.frames[next].t <= reading.t)
                filter.add(run.frames[next++]);
            const auto begin = std::chrono::steady_clock::now();
            filter.add(reading);  // sets off the image that waited for it
            const std::chrono::duration<double> time = std::chrono::steady_clock::now() - begin;
            (image ? image_seconds : reading_seconds) += time.count();
            ++(image ? images : readings);
        }
        filter.finish();
    }
    state.counters["ms_per_image"] = 1e3 * image_seconds / static_cast<double>(images);
    state.counters["us_per_reading"] = 1e6 * reading_seconds / static_cast<double>(readings);
}

BENCHMARK(iekf)->Arg(25)->Arg(50)->Arg(100)->Arg(200)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace vio
