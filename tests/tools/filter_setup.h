// What to run the recursive estimator on, from a command line, and the run.
#pragma once

#include <chrono>
#include <string>
#include <utility>
#include <vector>

#include "libvio/base/angles.h"
#include "libvio/base/errors.h"
#include "libvio/recursive/iekf.h"
#include "libvio/simulation/scenario.h"
#include "tests/feed.h"

namespace vio::test {

/// Scenario, estimators and number of seeds.
struct Setup {
    ScenarioOptions scenario;
    IekfOptions iekf;
    BatchOptions batch;
    // Noise densities that the estimators are told, if not the true ones.
    double gyro_noise_density = 0, accel_noise_density = 0;
    bool with_batch = true;
    bool stated = false;  // calibration as the recording would state it, with its errors
    int seeds = 1;
};

/// Of `PROGRAM COMMAND SCENARIO.ini [SEEDS] [ARGUMENT...]`, see filter_runs.cpp. Throws InputError.
inline Setup setup(int argc, char** argv) {
    if (argc < 3) throw InputError("vio_filter_runs: COMMAND SCENARIO.ini [SEEDS] [ARGUMENT]");
    Setup s;
    s.scenario = ScenarioOptions::from_file(argv[2]);
    s.scenario.tracks = true;
    OptionSet scenario, estimators;
    s.scenario.describe(scenario);
    s.iekf.describe(estimators);
    s.batch.describe(estimators);
    estimators.section("told");
    estimators.add("gyro_noise_density", &s.gyro_noise_density, "rad/s/sqrt(Hz)", {0, 10}, "");
    estimators.add("accel_noise_density", &s.accel_noise_density, "m/s^2/sqrt(Hz)", {0, 10}, "");
    std::vector<std::string> own;
    for (int i = 3; i < argc; ++i) {
        const std::string a = argv[i];
        if (a == "--no-batch")
            s.with_batch = false;
        else if (a.ends_with(".ini"))
            continue;
        else if (a.find('=') == std::string::npos)
            s.seeds = std::stoi(a);
        else if (a.starts_with("iekf.") || a.starts_with("batch.") || a.starts_with("told."))
            own.push_back(a);
        else
            scenario.set(a);
    }
    // What the scenario is, unless told otherwise.
    s.iekf.sigma_px = s.batch.sigma_px = s.scenario.track_model.noise_px;
    s.batch.gravity_norm = s.scenario.gravity;
    for (const std::string& a : own) estimators.set(a);
    return s;
}

/// One for each of several scenarios.
inline std::vector<Setup> setups(int argc, char** argv) {
    std::vector<Setup> all;
    for (int i = 2; i < argc && std::string(argv[i]).ends_with(".ini"); ++i) {
        std::swap(argv[2], argv[i]);
        all.push_back(setup(argc, argv));
        Setup& s = all.back();
        s.stated = true;
        // What a calibration with such errors would say of itself.
        s.iekf.imu_rotation_sigma = s.scenario.calibration.imu_rotation_deg * kDegree;
        s.iekf.imu_position_sigma = s.scenario.calibration.imu_position;
        std::swap(argv[2], argv[i]);
    }
    return all;
}

/// The seed-th recording, from 0 on.
inline ScenarioOptions scenario(const Setup& s, int seed) {
    ScenarioOptions options = s.scenario;
    options.seed += seed;
    return options;
}

/// What the filter made of a recording, in what time [s].
struct Filtered {
    Estimate estimate;
    std::vector<StatusEntry> status;
    double seconds = 0;
};

/// What the estimators are told.
inline Rig rig(const Simulation& sim, const Setup& s) {
    Rig rig = s.stated ? sim.stated_rig() : sim.rig();
    if (s.gyro_noise_density > 0) rig.imu_noise.gyro_noise_density = s.gyro_noise_density;
    if (s.accel_noise_density > 0) rig.imu_noise.accel_noise_density = s.accel_noise_density;
    return rig;
}

inline Filtered filtered(const Simulation& sim, const Setup& s) {
    const auto begin = std::chrono::steady_clock::now();
    Iekf filter(rig(sim, s), s.iekf, s.batch);
    test::feed(filter, sim);
    filter.finish();
    const std::chrono::duration<double> time = std::chrono::steady_clock::now() - begin;
    return {filter.estimate(), filter.status(), time.count()};
}

}  // namespace vio::test
