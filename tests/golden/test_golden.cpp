// The demo recording from end to end through the program, both estimators.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tests/cli/program.h"
#include "tests/unit/scratch_folder.h"

namespace vio::test {
namespace {

const std::string kDatasets = VIO_SOURCE_DIR "/datasets";
const std::string kRawlog = kDatasets + "/demo.rawlog";
const std::string kTruth = kDatasets + "/demo.truth.tum";

nlohmann::json evaluate(const std::string& result, const ScratchFolder& folder) {
    const ProgramResult evaluation = vio_slam(
        "evaluate " + result + " --against " + kTruth + " --align sim3 --json --rawlog " + kRawlog,
        folder.path().string());
    EXPECT_EQ(evaluation.exit_code, 0) << evaluation.err;
    return nlohmann::json::parse(evaluation.out, nullptr, false);
}

// Bounds of the demo: similarity-aligned position and scale, a pose for every image.
void expect_good(const nlohmann::json& evaluation, double max_rmse_m, double max_scale_error) {
    ASSERT_TRUE(evaluation.is_object());
    EXPECT_LT(evaluation["position_m"]["rmse"].get<double>(), max_rmse_m);
    EXPECT_LT(std::abs(evaluation["scale_error"].get<double>()), max_scale_error);
    EXPECT_EQ(evaluation["completion"]["share"].get<double>(), 1.0);
}

void expect_results(const std::string& folder) {
    for (const char* file :
         {"trajectory.tum", "trajectory_cov.txt", "trajectory.txt", "states.csv", "landmarks.ply",
          "landmarks.txt", "keyframes.simplemap", "scene.3Dscene", "options.ini", "summary.json"}) {
        EXPECT_TRUE(std::filesystem::is_regular_file(folder + "/" + file)) << file;
        EXPECT_GT(std::filesystem::file_size(folder + "/" + file), 0u) << file;
    }
    const cv::Mat picture = cv::imread(folder + "/snapshot.png");
    ASSERT_FALSE(picture.empty());
    cv::Scalar mean, deviation;
    cv::meanStdDev(picture, mean, deviation);
    EXPECT_GT(deviation[0] + deviation[1] + deviation[2], 3) << "the picture shows nothing";
}

TEST(Golden, DemoBatchFromBlindStart) {
    const ScratchFolder folder;
    const std::string out = folder / "out";
    const ProgramResult run =
        vio_slam("run " + kRawlog + " --estimator batch --start blind --output " + out,
                 folder.path().string());
    ASSERT_EQ(run.exit_code, 0) << run.err;
    EXPECT_EQ(run.err, "") << "progress must not show in a pipe";
    expect_results(out);
    expect_good(evaluate(out, folder), 0.005, 0.02);
}

TEST(Golden, DemoRecursive) {
    const ScratchFolder folder;
    const std::string out = folder / "out";
    const ProgramResult run =
        vio_slam("run " + kRawlog + " --estimator iekf --output " + out, folder.path().string());
    ASSERT_EQ(run.exit_code, 0) << run.err;
    expect_results(out);
    const nlohmann::json evaluation = evaluate(out, folder);
    expect_good(evaluation, 0.005, 0.02);
    // The filter's own images, after the batch that it starts from.
    EXPECT_GT(evaluation["after_start"]["poses"], 20);
    EXPECT_LT(evaluation["after_start"]["position_m"]["rmse"].get<double>(), 0.006);
    EXPECT_LT(evaluation["after_start"]["rotation_deg"]["rmse"].get<double>(), 0.8);
}

TEST(Golden, EqualRunsGiveEqualBytes) {
    const ScratchFolder folder;
    for (const char* out : {"a", "b"})
        ASSERT_EQ(vio_slam("run " + kRawlog + " --estimator iekf --output " + folder / out,
                           folder.path().string())
                      .exit_code,
                  0);
    for (const char* file : {"/trajectory.tum", "/trajectory_cov.txt", "/states.csv"}) {
        const std::string first = read_text(folder / "a" + file);
        EXPECT_FALSE(first.empty()) << file;
        EXPECT_TRUE(first == read_text(folder / "b" + file)) << file;
    }
}

TEST(Golden, ResultsUpToTheDamageAreKept) {
    const ScratchFolder folder;
    const std::string cut = folder / "cut.rawlog", out = folder / "out";
    std::filesystem::copy_file(kRawlog, cut);
    std::filesystem::resize_file(cut, std::filesystem::file_size(cut) * 6 / 10);
    const ProgramResult run =
        vio_slam("run " + cut + " --estimator iekf --output " + out, folder.path().string());
    EXPECT_GT(run.exit_code, 0);
    EXPECT_EQ(run.err.rfind("vio-slam: error: " + cut, 0), 0u) << run.err;
    EXPECT_NE(run.err.find(out), std::string::npos) << run.err;
    EXPECT_GT(read_text(out + "/trajectory.tum").size(), 1000u);
}

}  // namespace
}  // namespace vio::test
