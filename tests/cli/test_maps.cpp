// vio-slam run as MRPT's SLAM programs run, scenes on the way, and what its maps hold.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "libvio/io/ply.h"
#include "libvio/io/text.h"
#include "tests/cli/program.h"
#include "tests/unit/scratch_folder.h"
#include "tests/wanting.h"

namespace vio::test {
namespace {

namespace fs = std::filesystem;

const std::string kDemo = VIO_SOURCE_DIR "/datasets/demo.rawlog";
const std::string kTruth = VIO_SOURCE_DIR "/datasets/demo.truth.tum";

class Maps : public testing::Test {
 protected:
    ProgramResult run(const std::string& arguments, const std::string& environment = "") {
        return vio_slam(arguments, folder_.path().string(), environment);
    }
    std::string config(const std::string& keys) {
        write_text(folder_ / "my.ini", "[MappingApplication]\nSHOW_3D_LIVE = 1\n" + keys);
        return folder_ / "my.ini";
    }
    const ScratchFolder folder_;
};

TEST_F(Maps, RunsByAConfigurationAloneAsMrptsSlamProgramsDo) {
    const std::string ini = config(
        "rawlog_file = " + kDemo + "\nlogOutput_dir = " + folder_ / "LOG" +
        "\nground_truth_file = " + kTruth +
        "\nSAVE_3D_SCENES = 1  // with comments as in MRPT's own files\nSAVE_LOG_FREQUENCY = 25\n"
        "[iekf]\nprefix_images = 50  ; images\nstart_wanted_tilt = 1\ntime_offset_sigma = 0\n");
    const ProgramResult result = run("run " + ini + " --to 2.8");
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_NE(read_text(folder_ / "LOG/options.ini").find("prefix_images = 50"), std::string::npos);
    std::vector<std::string> scenes;
    for (const auto& entry : fs::directory_iterator(folder_ / "LOG/scenes"))
        if (entry.path().extension() == ".3Dscene") scenes.push_back(entry.path().stem());
    std::sort(scenes.begin(), scenes.end());
    ASSERT_EQ(scenes, (std::vector<std::string>{"000050", "000075"}));
    const bool pictures = fs::exists(folder_ / "LOG/snapshot.png");
    EXPECT_EQ(fs::exists(folder_ / "LOG/scenes/000075.png"), pictures);
    if (pictures) {
        const cv::Mat before = cv::imread(folder_ / "LOG/scenes/000050.png"),
                      after = cv::imread(folder_ / "LOG/scenes/000075.png");
        ASSERT_EQ(before.size(), after.size());
        EXPECT_GT(cv::norm(before, after, cv::NORM_L1) / double(before.total()), 0.5);
    }
    // A second run does not delete the first one's results.
    EXPECT_NE(run("run " + ini).err.find("overwrite"), std::string::npos);
    VIO_SKIP_FOR(pictures ? "" : "no picture was drawn: " + result.out);
}

TEST_F(Maps, TheCommandLineOverridesTheConfiguration) {
    const std::string ini =
        config("rawlog_file = nowhere.rawlog\nlogOutput_dir = " + folder_ / "LOG" + "\n");
    EXPECT_NE(run("run " + ini + " --output " + folder_ / "x").err.find("nowhere.rawlog"),
              std::string::npos);
    const ProgramResult result =
        run("run " + ini + " " + kDemo + " --to 2.2 --output " + folder_ / "mine");
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_TRUE(fs::exists(folder_ / "mine/trajectory.tum"));
    EXPECT_FALSE(fs::exists(folder_ / "LOG"));
    EXPECT_FALSE(fs::exists(folder_ / "mine/scenes"));
}

TEST_F(Maps, BadConfigurationsAreOneLine) {
    const auto error = [&](const std::string& arguments) {
        const ProgramResult result = run(arguments);
        EXPECT_EQ(result.exit_code, 1) << arguments;
        EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
        return result.err;
    };
    EXPECT_NE(error("run " + config("SAVE_LOG_FREQUENCY = 12abc\n")).find("12abc"),
              std::string::npos);
    EXPECT_NE(error("run " + config("SAVE_LOG_FREQUENCY = 0\n")).find("SAVE_LOG_FREQUENCY"),
              std::string::npos);
    EXPECT_NE(error("run " + config("")).find("RAWLOG"), std::string::npos);
    EXPECT_NE(error("run " + kDemo + " " + kDemo).find("one rawlog"), std::string::npos);
    EXPECT_NE(error("run gone.ini " + kDemo).find("gone.ini"), std::string::npos);
    EXPECT_NE(error("run " + kDemo + " --estimator batch --scene-every 5 --output " + folder_ / "x")
                  .find("iekf"),
              std::string::npos);
}

// The demo's images are of textured boards: the landmarks take their grey values.
TEST_F(Maps, LandmarksHaveTheColoursOfTheImages) {
    ASSERT_EQ(
        run("run " + kDemo + " --to 2.2 --set iekf.start_wanted_tilt=1 --output " + folder_ / "out")
            .exit_code,
        0);
    const auto landmarks = read_ply(folder_ / "out/landmarks.ply");
    ASSERT_GT(landmarks.size(), 50u);
    int least = 255, most = 0;
    for (const LandmarkEstimate& landmark : landmarks) {
        ASSERT_TRUE(landmark.rgb);
        least = std::min<int>(least, (*landmark.rgb)[1]);
        most = std::max<int>(most, (*landmark.rgb)[1]);
    }
    EXPECT_GT(most - least, 60);
    for (const char* how : {"", " --ascii", " --colour uncertainty"})
        EXPECT_EQ(
            run("export " + folder_ / "out" + " --as ply -o " + folder_ / "x.ply" + how).exit_code,
            0);
}

// Where the picture cannot be drawn, everything else is there, and the report says what to install.
TEST_F(Maps, WithoutOpenGlARunCompletesAndSaysWhatToInstall) {
    const ProgramResult result =
        run("run " + kDemo + " --to 2.2 --scene-every 50 --output " + folder_ / "out",
            "__EGL_VENDOR_LIBRARY_DIRS=" + folder_ / "none" + " __EGL_VENDOR_LIBRARY_FILENAMES=/x");
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_NE(result.out.find("apt install"), std::string::npos) << result.out;
    EXPECT_FALSE(fs::exists(folder_ / "out/snapshot.png"));
    EXPECT_TRUE(fs::exists(folder_ / "out/scene.3Dscene"));
    EXPECT_FALSE(fs::is_empty(folder_ / "out/scenes"));
}

}  // namespace
}  // namespace vio::test
