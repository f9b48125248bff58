// The scenario files of datasets/stress: each has the property that makes it hard.
#include <gtest/gtest.h>

#include <filesystem>
#include <set>

#include "libvio/simulation/scenario.h"

namespace vio {
namespace {

const std::string kFolder = std::string(VIO_SOURCE_DIR) + "/datasets/stress/";

Simulation stress(const std::string& name) {
    return Simulation(ScenarioOptions::from_file(kFolder + name));
}

struct Extremes {
    double acceleration = 0, rate = 0;  // largest [m/s^2], [rad/s]
    double spread = 0;                  // largest distance between positions at images [m]
};

Extremes extremes(const Simulation& simulation) {
    Extremes e;
    const auto& times = simulation.image_times();
    const double begin = simulation.seconds(times.front()), end = simulation.seconds(times.back());
    for (double t = begin; t <= end; t += 2e-3) {
        const Motion motion = simulation.trajectory().at(t);
        e.acceleration = std::max(e.acceleration, motion.a_W.norm());
        e.rate = std::max(e.rate, motion.omega_B.norm());
    }
    for (const StateEstimate& a : simulation.truth())
        e.spread = std::max(e.spread, (a.T_W_B.p - simulation.truth()[0].T_W_B.p).norm());
    return e;
}

/// Share of the observations that are more than ten sigma from where their feature was picked.
double gross_share(const Simulation& simulation) {
    const double limit = 10 * simulation.options().track_model.noise_px;
    double gross = 0, all = 0;
    for (size_t i = 0; i < simulation.truth().size(); ++i) {
        const Pose T_C_W = (simulation.truth()[i].T_W_B * simulation.rig().T_B_C).inverse();
        for (const FeatureObservation& o : simulation.tracks().frames[i].features) {
            const auto uv = simulation.rig().camera->project(
                T_C_W * simulation.tracks().points_W.at(o.feature_id));
            gross += !uv || (*uv - o.uv_px).norm() > limit ? 1 : 0;
            all += 1;
        }
    }
    return gross / all;
}

TEST(StressScenarios, AllLoadAndTheirIdealReadingsIntegrateToTheTruth) {
    int files = 0;
    for (const auto& entry : std::filesystem::directory_iterator(kFolder)) {
        const Simulation simulation(ScenarioOptions::from_file(entry.path().string()));
        const ClosingError error = closing_error(simulation);
        EXPECT_LT(error.position_m, 1e-3) << entry.path();
        EXPECT_LT(error.rotation_rad, 1e-5) << entry.path();
        EXPECT_GT(statistics_of(simulation).points_per_image, 40) << entry.path();
        ++files;
    }
    EXPECT_GE(files, 12);
}

TEST(StressScenarios, ErraticMotionIsImpulsive) {
    const Extremes e = extremes(stress("erratic.ini")), calm = extremes(stress("base.ini"));
    EXPECT_GT(e.acceleration, 30);
    EXPECT_LT(calm.acceleration, 5);
}

TEST(StressScenarios, UnobservableMotions) {
    const Simulation rotation = stress("pure_rotation.ini");
    EXPECT_LT(extremes(rotation).spread, 1e-12);
    EXPECT_GT(extremes(rotation).rate, 0.5);
    EXPECT_EQ(rotation.rig().T_B_C.p.norm(), 0);
    const Extremes straight = extremes(stress("straight.ini"));
    EXPECT_LT(straight.acceleration, 1e-9);
    EXPECT_LT(straight.rate, 1e-9);
    EXPECT_GT(straight.spread, 1);
    const Extremes hover = extremes(stress("hover.ini"));
    EXPECT_LT(hover.spread, 0.06);
    EXPECT_GT(hover.spread, 0.01);
}

TEST(StressScenarios, ScenesArePlanarAndFar) {
    const Simulation planar = stress("planar.ini"), far = stress("far_points.ini");
    for (const auto& [id, p_W] : planar.tracks().points_W) EXPECT_NEAR(p_W.z(), 0, 1e-9);
    for (const auto& [id, p_W] : far.tracks().points_W) EXPECT_GT(p_W.norm(), 300);
}

TEST(StressScenarios, ThirtyPercentOfTheObservationsAreGrosslyWrong) {
    // The tracks without stress show how seldom noise passes for a gross error.
    EXPECT_EQ(gross_share(stress("base.ini")), 0);
    EXPECT_NEAR(gross_share(stress("mistracks.ini")), 0.3, 0.03);
    // Of two-dimensional errors with 30 px per axis, 5 % are below ten pixels.
    EXPECT_NEAR(gross_share(stress("outliers.ini")), 0.3 * 0.95, 0.015);
}

TEST(StressScenarios, MessagesAreLostAndRepeated) {
    const Simulation simulation = stress("messages.ini");
    std::set<std::pair<int, int>> seen;
    for (const StreamEntry& entry : simulation.stream())
        seen.insert({static_cast<int>(entry.kind), entry.index});
    const auto count = [&](StreamEntry::Kind kind) {
        return std::count_if(seen.begin(), seen.end(),
                             [&](const auto& e) { return e.first == static_cast<int>(kind); });
    };
    const double images = static_cast<double>(simulation.image_times().size());
    const double readings = static_cast<double>(simulation.imu().size());
    // Losses come in runs of three on average: the count spreads by the root of its triple.
    EXPECT_NEAR(static_cast<double>(count(StreamEntry::Kind::kImage)), 0.9 * images,
                4 * std::sqrt(3 * 0.1 * images));
    EXPECT_NEAR(static_cast<double>(count(StreamEntry::Kind::kImu)), 0.95 * readings,
                4 * std::sqrt(3 * 0.05 * readings));
    EXPECT_GT(simulation.stream().size(), seen.size() * 1.03);
}

TEST(StressScenarios, CalibrationIsStatedWrong) {
    const Simulation offset = stress("time_offset.ini");
    EXPECT_EQ(offset.rig().time_offset, 0.03);
    EXPECT_EQ(offset.stated_rig().time_offset, 0);
    const Simulation extrinsics = stress("extrinsics.ini");
    const Pose error = extrinsics.rig().T_I_C().inverse() * extrinsics.stated_rig().T_I_C();
    EXPECT_GT(Eigen::AngleAxisd(error.R).angle(), 0.01);
    EXPECT_GT(error.p.norm(), 0.01);
    EXPECT_LT(Eigen::AngleAxisd(error.R).angle(), 0.12);
}

}  // namespace
}  // namespace vio
