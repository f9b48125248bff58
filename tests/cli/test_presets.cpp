// The presets of share/: each is read, and a simulated recording of its kind is followed with it.
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/cli/program.h"
#include "tests/unit/scratch_folder.h"

namespace vio::test {
namespace {

const std::string kShare = std::string(VIO_SOURCE_DIR) + "/share/";
const std::string kDatasets = std::string(VIO_SOURCE_DIR) + "/datasets/";

class Presets : public ::testing::Test {
 protected:
    std::string vio_slam_out(const std::string& arguments) {
        const ProgramResult result = vio_slam(arguments, folder_.path().string());
        EXPECT_EQ(result.exit_code, 0) << arguments << "\n" << result.err;
        return result.out;
    }

    std::string simulated(const std::string& text) {
        std::ofstream(folder_ / "scenario.ini") << text;
        vio_slam_out("simulate " + (folder_ / "scenario.ini") + " -o " + (folder_ / "r.rawlog"));
        return folder_ / "r";
    }

    // Largest tolerable RMSE after SE(3) alignment [m].
    void expect_followed(const std::string& recording, const std::string& motion,
                         const std::string& imu, double position) {
        vio_slam_out("run " + recording + ".rawlog --config " + kShare + "presets/" + motion +
                     ".ini --calibration " + kShare + "imu/" + imu + ".ini -o " +
                     (folder_ / "result"));
        const auto measures = nlohmann::json::parse(
            vio_slam_out("evaluate " + (folder_ / "result") + " --against " + recording +
                         ".truth.tum --rawlog " + recording + ".rawlog --json"));
        EXPECT_LT(measures["position_m"]["rmse"].get<double>(), position);
        EXPECT_GT(measures["completion"]["share"].get<double>(), 0.95);
    }

    ScratchFolder folder_;
};

// Bounds: about three times what was measured, all below 1 % of the path.
TEST_F(Presets, HandheldWithAConsumerImu) {
    expect_followed(kDatasets + "demo", "handheld", "consumer", 0.015);
}

TEST_F(Presets, DroneWithAConsumerImu) {
    expect_followed(simulated("[scenario]\ninclude = " + kDatasets + "stress/base.ini\n"), "drone",
                    "consumer", 0.03);
}

// A tactical unit on the same flight: readings of its own noise.
TEST_F(Presets, DroneWithATacticalImu) {
    expect_followed(simulated("[scenario]\ninclude = " + kDatasets +
                              "stress/base.ini\n[imu]\ngyro_noise_density = 4.36e-5\n"
                              "accel_noise_density = 1.17e-3\ngyro_bias_random_walk = 5.7e-8\n"
                              "accel_bias_random_walk = 1.16e-5\ngyro_bias_sigma = 2e-5\n"
                              "accel_bias_sigma = 0.0075\n"),
                    "drone", "tactical", 0.015);
}

TEST_F(Presets, GroundRoverWithAConsumerImu) {
    expect_followed(
        simulated("[scenario]\ninclude = " + kDatasets +
                  "rover.ini\n[trajectory]\nroute = 15.4 0.0, 12.3 6.1, 4.4 9.6, -4.4 9.2, -12.9 "
                  "6.9\nduration = 100\nstops = 4\n[camera]\ncount = 145\n[odometry]\nmake = "
                  "false\n[gps]\nmake = false\n"),
        "ground_rover", "consumer", 0.18);
}

}  // namespace
}  // namespace vio::test
