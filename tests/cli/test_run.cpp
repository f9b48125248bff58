// What `run` says and counts, on the demo recording.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "tests/cli/program.h"
#include "tests/unit/scratch_folder.h"

namespace vio::test {
namespace {

const std::string kDemo = VIO_SOURCE_DIR "/datasets/demo.rawlog";
const std::string kTruth = VIO_SOURCE_DIR "/datasets/demo.truth.tum";

class Run : public ::testing::Test {
 protected:
    ProgramResult run(const std::string& arguments) {
        return vio_slam(arguments, scratch_.path().string());
    }
    nlohmann::json summary(const std::string& out) {
        return nlohmann::json::parse(read_text(out + "/summary.json"), nullptr, false);
    }

    ScratchFolder scratch_;
};

// Features are stated to be known a thousand times better than they are: the batch refuses its
// start, and its own reason is told.
TEST_F(Run, BatchThatFailsSaysWhy) {
    const ProgramResult result = run("run " + kDemo +
                                     " --estimator batch --start blind --set "
                                     "batch.sigma_px=0.001 --to 1.5 -o " +
                                     (scratch_ / "out"));
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_NE(result.err.find("no pose could be estimated"), std::string::npos) << result.err;
    EXPECT_NE(result.err.find("sigma_px"), std::string::npos) << result.err;
}

// Poses at readings are no images with a pose; the evaluation counts images.
TEST_F(Run, PosesAtReadingsAreNotCountedAsImages) {
    const std::string out = scratch_ / "out";
    ASSERT_EQ(run("run " + kDemo + " --every-reading -o " + out).exit_code, 0);
    const nlohmann::json json = summary(out);
    EXPECT_EQ(json["images"], 152);
    EXPECT_EQ(json["images_in_recording"], 152);
    EXPECT_GT(json["poses"], 300);
    const auto evaluation = nlohmann::json::parse(
        run("evaluate " + out + " --against " + kTruth + " --align sim3 --json").out, nullptr,
        false);
    ASSERT_TRUE(evaluation.is_object());
    EXPECT_EQ(evaluation["completion"]["with_pose"], 152);
    EXPECT_EQ(evaluation["completion"]["images"], 152);
}

// A motion that is never known well enough is no success, and its poses complete nothing.
TEST_F(Run, NothingButLostPosesIsAFailure) {
    const std::string out = scratch_ / "out";
    const ProgramResult result =
        run("run " + kDemo + " --set iekf.start_velocity_sigma=0.001 -o " + out);
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_NE(result.err.find("track was lost all the time"), std::string::npos) << result.err;
    const nlohmann::json json = summary(out);
    EXPECT_EQ(json["images"], 152);
    EXPECT_EQ(json["images_lost"], 152);
    EXPECT_EQ(json["converged"], false);
    const ProgramResult evaluation = run("evaluate " + out + " --against " + kTruth);
    EXPECT_NE(evaluation.out.find("completion       0.0 % (0 of 152 images)"), std::string::npos)
        << evaluation.out;
    EXPECT_NE(evaluation.out.find("152 of 152 poses are lost"), std::string::npos);
}

// What is wrong with a file behind the part that was asked for does not matter.
TEST_F(Run, DamageBehindThePartIsNotReached) {
    const std::string cut = scratch_ / "cut.rawlog";
    std::filesystem::copy_file(kDemo, cut);
    std::filesystem::resize_file(cut, std::filesystem::file_size(cut) * 8 / 10);
    EXPECT_EQ(run("run " + cut + " -o " + (scratch_ / "whole")).exit_code, 1);
    const ProgramResult part = run("run " + cut + " --to 2.5 -o " + (scratch_ / "part"));
    EXPECT_EQ(part.exit_code, 0) << part.err;
    EXPECT_GT(summary(scratch_ / "part")["images"], 60);
}

// The clock is stated 4 ms off: the filter finds that and says so; what it was told stays as it
// was.
TEST_F(Run, TheFilterTellsTheMountThatItFound) {
    const std::string calibration = scratch_ / "late.ini", out = scratch_ / "out";
    std::ofstream(calibration) << "[imu]\ntime_offset_s = 0.004\n";
    const ProgramResult result =
        run("run " + kDemo + " --calibration " + calibration + " -o " + out);
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_NE(result.out.find("mount "), std::string::npos) << result.out;
    const nlohmann::json rig = summary(out)["rig"];
    ASSERT_EQ(rig.size(), 7u);
    EXPECT_EQ(rig[6]["name"], "time offset");
    const double sigma = rig[6]["sigma"].get<double>();
    EXPECT_LT(sigma, 0.001);
    EXPECT_NEAR(rig[6]["change"].get<double>(), -0.004, 4 * sigma);
    EXPECT_NE(read_text(out + "/calibration.ini").find("time_offset_s = 0.004"), std::string::npos);
}

TEST_F(Run, OptionsOfTheOtherEstimatorAreRefused) {
    for (const char* options : {"--estimator batch --every-reading", "--start staged"}) {
        const ProgramResult result =
            run("run " + kDemo + " " + options + " -o " + (scratch_ / "out"));
        EXPECT_EQ(result.exit_code, 1) << options;
        EXPECT_NE(result.err.find("is for --estimator"), std::string::npos) << result.err;
    }
}

}  // namespace
}  // namespace vio::test
