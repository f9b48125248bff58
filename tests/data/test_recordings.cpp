// Recorded data from end to end through the program, with the built-in options. The data are not
// part of the project: $VIO_DATA, or ../shared/data beside the source tree, else skipped.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "libvio/check/inertial.h"
#include "libvio/io/text.h"
#include "tests/cli/program.h"
#include "tests/unit/scratch_folder.h"

namespace vio::test {
namespace {

std::string data_folder() {
    if (const char* folder = std::getenv("VIO_DATA")) return folder;
    return VIO_SOURCE_DIR "/../shared/data";
}

class Recordings : public ::testing::Test {
 protected:
    void require(const std::string& set) {
        if (!std::filesystem::is_directory(data_folder() + "/" + set))
            GTEST_SKIP() << data_folder() << "/" << set << " is absent; set VIO_DATA";
    }

    void run(const std::string& arguments) {
        const ProgramResult result = vio_slam(arguments, folder_.path().string());
        ASSERT_EQ(result.exit_code, 0) << arguments << "\n" << result.err;
    }

    nlohmann::json evaluate(const std::string& arguments) {
        const ProgramResult result = vio_slam(
            "evaluate " + folder_ / "out" + " --json " + arguments, folder_.path().string());
        EXPECT_EQ(result.exit_code, 0) << result.err;
        const auto json = nlohmann::json::parse(result.out, nullptr, false);
        if (json.is_object())
            std::printf("position RMSE %.4f m, rotation RMSE %.3f deg, scale error %+.3f %%\n",
                        json["position_m"]["rmse"].get<double>(),
                        json["rotation_deg"]["rmse"].get<double>(),
                        100 * json["scale_error"].get<double>());
        return json;
    }

    void import_mh01() {
        run("import asl " + data_folder() + "/euroc_mh01_15s -o " + folder_ / "mh01.rawlog");
    }

    // Every image from 2 s after the first on has a pose.
    nlohmann::json evaluate_mh01() {
        auto json = evaluate("--against " + folder_ / "mh01.truth.tum" + " --rawlog " +
                             folder_ / "mh01.rawlog" + " --start-offset 2");
        EXPECT_EQ(json["completion"]["share"].get<double>(), 1.0);
        EXPECT_LT(std::abs(json["scale_error"].get<double>()), 0.015);
        return json;
    }

    // Rawlog of the corners, and the body's pose from the board, image by image.
    void import_april() {
        const std::string source = data_folder() + "/euroc_imu_april";
        const auto shell = [](const std::string& command) {
            ASSERT_EQ(std::system((command + " >/dev/null").c_str()), 0) << command;
        };
        shell("sh " VIO_SOURCE_DIR "/tests/make_april_asl.sh " + source + " " + folder_ / "asl");
        run("import asl " + folder_ / "asl" + " -o " + folder_ / "april.rawlog");
        shell(VIO_BOARD_TRUTH_PROGRAM " " + folder_ / "april.rawlog" + " " + source +
              "/target.csv " + folder_ / "board.tum");
    }

    ScratchFolder folder_;
};

// The vehicle stands for five seconds, with its motors on for some of them; then it flies, evenly
// at times.
TEST_F(Recordings, TheFlightOfV101IsNotCalledRest) {
    require("euroc_v101_imu_gt");
    if (IsSkipped()) return;
    TextRows rows(data_folder() + "/euroc_v101_imu_gt/imu0.csv");
    std::vector<ImuReading> readings, flight;
    while (rows.next()) {
        const auto vector = [&](size_t first) {
            return Eigen::Vector3d(rows.number(first), rows.number(first + 1),
                                   rows.number(first + 2));
        };
        readings.push_back({rows.integer(0), vector(1), vector(4)});
        if (to_seconds(readings.back().t - readings.front().t) > 5)
            flight.push_back(readings.back());
    }
    ImuNoise stated;
    stated.gyro_noise_density = 1.6968e-4;
    stated.accel_noise_density = 2e-3;
    EXPECT_EQ(find_rest(flight, stated).seconds, 0);
    // Nor does a second that ten times as much noise could hide become a verdict.
    for (const ImuNoise& noise : {stated, ImuNoise()})
        for (const Finding& finding : check_readings(readings, noise))
            EXPECT_LT(finding.grade, Grade::warning) << one_line(finding);
}

TEST_F(Recordings, Mh01Batch) {
    require("euroc_mh01_15s");
    if (IsSkipped()) return;
    import_mh01();
    run("run " + folder_ / "mh01.rawlog" + " --estimator batch --output " + folder_ / "out");
    EXPECT_LT(evaluate_mh01()["position_m"]["rmse"].get<double>(), 0.010);
}

TEST_F(Recordings, Mh01Recursive) {
    require("euroc_mh01_15s");
    if (IsSkipped()) return;
    import_mh01();
    run("run " + folder_ / "mh01.rawlog" + " --estimator iekf --output " + folder_ / "out");
    EXPECT_LT(evaluate_mh01()["position_m"]["rmse"].get<double>(), 0.015);
}

// The board's corner positions are unknown to the estimator.
TEST_F(Recordings, AprilBatchOverTwentySeconds) {
    require("euroc_imu_april");
    if (IsSkipped()) return;
    import_april();
    run("run " + folder_ / "april.rawlog" + " --estimator batch --from 25 --to 45 --output " +
        folder_ / "out");
    const auto json = evaluate("--against " + folder_ / "board.tum");
    EXPECT_LT(json["position_m"]["rmse"].get<double>(), 0.010);
    EXPECT_LT(json["rotation_deg"]["rmse"].get<double>(), 0.5);
}

TEST_F(Recordings, AprilRecursiveOverTheWhole) {
    require("euroc_imu_april");
    if (IsSkipped()) return;
    import_april();
    run("run " + folder_ / "april.rawlog" + " --estimator iekf --output " + folder_ / "out");
    const auto json = evaluate("--against " + folder_ / "board.tum");
    EXPECT_LT(json["position_m"]["rmse"].get<double>(), 0.030);
    EXPECT_LT(json["rotation_deg"]["rmse"].get<double>(), 1.0);
}

}  // namespace
}  // namespace vio::test
