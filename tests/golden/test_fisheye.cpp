// A fisheye camera with a field of 190 degrees from end to end through the program: rendered
// images, the motion, and the picture of its tracks.
#include <nlohmann/json.hpp>

#include "tests/cli/program.h"
#include "tests/golden/pictures.h"
#include "tests/unit/scratch_folder.h"

namespace vio::test {
namespace {

class Fisheye : public ::testing::Test {
 protected:
    void expect_runs(const std::string& arguments) {
        const ProgramResult result = vio_slam(arguments, folder_.path().string());
        ASSERT_EQ(result.exit_code, 0) << arguments << "\n" << result.err;
        printed_ = result.out;
    }
    // The first image from that time on [s], with the tracks of the last ones.
    cv::Mat tracks(const std::string& from) {
        const std::string file = folder_ / "tracks.png";
        expect_runs("render " + rawlog_ + " --images 1 --from " + from + " -o " + file);
        cv::Mat small;
        cv::resize(cv::imread(file), small, {480, 360}, 0, 0, cv::INTER_AREA);
        return small;
    }

    ScratchFolder folder_;
    const std::string rawlog_ = folder_ / "fisheye.rawlog", result_ = folder_ / "result",
                      truth_ = folder_ / "fisheye.truth.tum";
    std::string printed_;
};

// Two seconds of the demo's motion.
TEST_F(Fisheye, IsTrackedEstimatedAndDrawn) {
    expect_runs("simulate " VIO_SOURCE_DIR "/datasets/demo.ini -o " + rawlog_ +
                " --set camera.model=fisheye --set camera.max_angle=95 --set camera.width=320"
                " --set camera.height=240 --set 'camera.intrinsics=100 100 159.5 119.5'"
                " --set 'camera.distortion=0.01 -0.005 0.001 0' --set camera.count=60"
                " --set images.row_fill=1 --set images.grey_step=1");
    expect_runs("run " + rawlog_ + " --estimator iekf --output " + result_);
    expect_runs("evaluate " + result_ + " --against " + truth_ + " --align yaw --json --rawlog " +
                rawlog_);
    const auto evaluation = nlohmann::json::parse(printed_, nullptr, false);
    ASSERT_TRUE(evaluation.is_object()) << printed_;
    EXPECT_EQ(evaluation["completion"]["share"].get<double>(), 1);
    // A single run's errors are alike throughout: chi-square of six degrees of freedom, 99.9 %. It
    // is sure of itself, too: of the path's metre by a few per cent.
    EXPECT_LT(evaluation["nees"]["pose"]["mean"].get<double>(), 22.5);
    EXPECT_LT(evaluation["position_m"]["rmse"].get<double>(), 0.03);
    EXPECT_LT(evaluation["rotation_deg"]["rmse"].get<double>(), 1);

    expect_as_stored(tracks("1.95"), "fisheye_tracks");
    EXPECT_GT(visible_difference(tracks("1.75"), tracks("1.95")), kAlike)
        << "six images later everything has moved";
}

}  // namespace
}  // namespace vio::test
