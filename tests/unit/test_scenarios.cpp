// The scenario files of datasets/, against what they promise.
#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <memory>
#include <sstream>

#include "libvio/simulation/export.h"
#include "libvio/simulation/paths.h"
#include "libvio/simulation/scenario.h"
#include "tests/unit/scratch_folder.h"

namespace vio {
namespace {

std::string dataset(const std::string& name) {
    return std::string(VIO_SOURCE_DIR) + "/datasets/" + name;
}

// Made once for all tests of it.
const Simulation& simulation_of(const std::string& name) {
    static std::map<std::string, std::unique_ptr<Simulation>> made;
    auto& simulation = made[name];
    if (!simulation)
        simulation = std::make_unique<Simulation>(ScenarioOptions::from_file(dataset(name)));
    return *simulation;
}

class ImitatedExperiment : public ::testing::TestWithParam<const char*> {};

TEST_P(ImitatedExperiment, HasThePapersStatisticsWithinFivePercent) {
    const Simulation& simulation = simulation_of(GetParam());
    int stated = 0;
    for (const ComparedStatistic& row :
         compared(simulation.options().paper, statistics_of(simulation))) {
        stated += row.paper > 0 ? 1 : 0;
        EXPECT_LE(std::abs(row.deviation()), 0.05)
            << row.name << ": " << row.paper << " in the paper, here " << row.simulated;
    }
    EXPECT_GE(stated, 5) << "the file does not state the paper's figures";
}

TEST_P(ImitatedExperiment, HasItsTableInTheReadme) {
    const Simulation& simulation = simulation_of(GetParam());
    std::string table = statistics_table(simulation);
    // Without its last line, which is rounding.
    table.resize(table.rfind("| noise-free"));
    std::ostringstream readme;
    readme << std::ifstream(dataset("README.md")).rdbuf();
    EXPECT_NE(readme.str().find(table), std::string::npos) << table;
}

TEST_P(ImitatedExperiment, IdealReadingsIntegrateToTheTrueFinalPose) {
    const Simulation& simulation = simulation_of(GetParam());
    const ClosingError error = closing_error(simulation);
    EXPECT_LT(error.position_m, 1e-3);
    EXPECT_LT(error.rotation_rad, 1e-5);
}

INSTANTIATE_TEST_SUITE_P(Scenarios, ImitatedExperiment,
                         ::testing::Values("perspective_arm.ini", "crane.ini", "rover.ini",
                                           "rover_sparse.ini", "omnidirectional_arm_1.ini",
                                           "omnidirectional_arm_2.ini",
                                           "omnidirectional_arm_3.ini"));

TEST(StraightLegs, StopAtControlPointsAndKeepToTheLinesBetween) {
    const std::vector<Waypoint> corners{{1, {Eigen::Matrix3d::Identity(), {0, 0, 1}}},
                                        {5, {Eigen::Matrix3d::Identity(), {2, 0, 1}}},
                                        {8, {Eigen::Matrix3d::Identity(), {2, 3, 2}}}};
    const auto trajectory =
        SplineTrajectory::through(straight_legs(corners, 0.5, 0.05), CurveEnds::kAtRest);
    for (const Waypoint& corner : corners) {
        const Motion motion = trajectory.at(corner.t);
        EXPECT_LT((motion.T_W_B.p - corner.T_W_B.p).norm(), 1e-12);
        EXPECT_LT(motion.v_W.norm(), 1e-3);  // of 1 m/s: the spline between waypoints
    }
    for (double t = 1; t < 5; t += 0.03)
        EXPECT_LT(trajectory.at(t).T_W_B.p.tail<2>().cwiseAbs().maxCoeff(), 1 + 1e-4) << t;
    // Cruising speed: distance over the time less one ramp.
    EXPECT_NEAR(trajectory.at(3).v_W.x(), 2 / 3.5, 1e-4);
    EXPECT_NEAR(trajectory.path_length(), 2 + std::sqrt(10), 1e-3);
}

TEST(Shake, HasTheStatedSpreadAndLeavesTheEndsAlone) {
    std::vector<Waypoint> still;
    for (int i = 0; i <= 20000; ++i) still.push_back({0.02 * i, {}});
    Random random(2, "shake");
    const auto points = shaken(still, {0.02, 0.1, 2}, random);
    EXPECT_EQ(points.front().T_W_B.p.norm(), 0);
    EXPECT_EQ(points.back().T_W_B.p.norm(), 0);
    double squares = 0;
    for (const Waypoint& point : points) squares += point.T_W_B.p.squaredNorm();
    // Eighteen sines of known power: only their beats over 400 s are random.
    EXPECT_NEAR(std::sqrt(squares / (3.0 * static_cast<double>(points.size()))), 0.1, 2e-3);
}

std::string bytes(const std::string& file) {
    std::ostringstream text;
    text << std::ifstream(file, std::ios::binary).rdbuf();
    return text.str();
}

TEST(Determinism, SameSeedSameBytesWhateverTheThreads) {
    const test::ScratchFolder folder;
    ScenarioOptions options = ScenarioOptions::from_file(dataset("rover.ini"));
    options.image_count = 3;
    options.image_width = 160, options.image_height = 120;
    options.render = true;
    options.motion.shake_angle_deg = 0.2;
    options.track_model.mistrack_rate = 0.1;
    options.messages.duplicate_rate = options.messages.imu_drop_rate = 0.1;
    options.calibration.camera_rotation_deg = 0.1;
    const auto made = [&](const std::string& name, int threads, int seed) {
        options.rendering.threads = threads;
        options.seed = seed;
        write_simulation(Simulation(options), folder / name + ".rawlog");
        std::string all;
        for (const char* ending :
             {".rawlog", ".calibration.ini", ".truth.tum", ".truth_states.csv", ".truth_points.csv",
              ".truth_odometry.csv", ".truth_gps.csv", ".truth_calibration.ini"}) {
            const std::string part = bytes(folder / name + ending);
            EXPECT_FALSE(part.empty()) << ending;
            all += part;
        }
        return all;
    };
    const std::string one = made("one", 1, 10);
    EXPECT_TRUE(one == made("three", 3, 10)) << "bytes depend on the number of threads";
    EXPECT_TRUE(one == made("again", 0, 10)) << "bytes differ from run to run";
    EXPECT_FALSE(one == made("other", 1, 11)) << "the seed does nothing";
}

TEST(ScenarioFile, IncludesAnotherAndMayDifferFromIt) {
    const test::ScratchFolder folder;
    std::ofstream(folder / "base.ini") << "[scenario]\nname = base\nseed = 5\n[camera]\nrate = 7\n";
    std::ofstream(folder / "other.ini") << "[scenario]\ninclude = base.ini\nname = other\n";
    const ScenarioOptions options =
        ScenarioOptions::from_file(folder / "other.ini", {"camera.width=100"});
    EXPECT_EQ(options.name, "other");
    EXPECT_EQ(options.seed, 5);
    EXPECT_EQ(options.image_rate, 7);
    EXPECT_EQ(options.image_width, 100);
    std::ofstream(folder / "base.ini") << "[scenario]\ninclude = other.ini\n";
    EXPECT_THROW(ScenarioOptions::from_file(folder / "other.ini"), InputError);
    const std::string too_long(300, 'x');  // for any file system
    for (const std::string& name : {std::string("gone.ini"), too_long}) {
        std::ofstream(folder / "base.ini") << "[scenario]\ninclude = " << name << '\n';
        EXPECT_THROW(ScenarioOptions::from_file(folder / "other.ini"), InputError) << name;
    }
}

}  // namespace
}  // namespace vio
