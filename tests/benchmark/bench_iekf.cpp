// Cost of the recursive estimator alone, over the number of features: per image and per reading.
#include <benchmark/benchmark.h>

#include <ctime>

#include "libvio/recursive/iekf.h"
#include "tests/simulated_run.h"

namespace vio {
namespace {

// On processors that others use too, time passes while nothing is worked on.
double processor_seconds() {
    timespec now{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// Arguments: features tracked at once, landmarks kept in the state.
void iekf(benchmark::State& state) {
    test::SimulatedRunOptions simulated;
    simulated.seconds = 8;
    simulated.features = static_cast<int>(state.range(0));
    const test::SimulatedRun run = test::simulate_run(simulated);
    IekfOptions options;
    options.message_window = 0;  // each message is worked on when it is added
    options.max_landmarks = static_cast<int>(state.range(1));
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
            const double begin = processor_seconds();
            filter.add(reading);  // sets off the image that waited for it
            (image ? image_seconds : reading_seconds) += processor_seconds() - begin;
            ++(image ? images : readings);
        }
        filter.finish();
    }
    state.counters["ms_per_image"] = 1e3 * image_seconds / static_cast<double>(images);
    state.counters["us_per_reading"] = 1e6 * reading_seconds / static_cast<double>(readings);
}

BENCHMARK(iekf)
    ->ArgNames({"features", "landmarks"})
    ->Args({10, 10})
    ->Args({25, 25})
    ->Args({50, 50})
    ->Args({100, 50})
    ->Args({100, 100})
    ->Args({200, 50})
    ->Args({200, 200})
    ->Args({400, 400})
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace vio
