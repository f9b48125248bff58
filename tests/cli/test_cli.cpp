// Every sub-command tells bad input in one clear line and a non-zero exit code.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "libvio/camera/intrinsics.h"
#include "libvio/camera/perspective.h"
#include "libvio/io/calibration_file.h"
#include "libvio/io/rawlog_writer.h"
#include "libvio/io/recording.h"
#include "libvio/io/text.h"
#include "tests/cli/program.h"
#include "tests/unit/scratch_folder.h"
#include "tests/wanting.h"

namespace vio::test {
namespace {

Rig calibrated_rig() {
    PerspectiveParameters p;
    p.width = 64, p.height = 48;
    p.fx = p.fy = 50, p.cx = 31.5, p.cy = 23.5;
    Rig rig;
    rig.camera = std::make_shared<PerspectiveCamera>(p);
    return rig;
}

struct Content {
    bool imu = true, images = true, calibration = true;
};

// One second of a rig at rest: well-formed, whatever can be estimated from it.
void write_rawlog(const std::string& file, const Content& content) {
    constexpr TimeNs kStart = 1'600'000'000'000'000'000, kStep = 5'000'000;
    Rig rig = calibrated_rig();
    if (!content.calibration) rig.camera.reset();
    RawlogWriter writer(file, rig);
    cv::Mat image(48, 64, CV_8UC1);
    cv::RNG rng(1);
    for (int i = 0; i <= 200; ++i) {
        const TimeNs t = kStart + i * kStep;
        if (content.imu) writer.write(ImuReading{t, {0, 0, 0}, {0, 0, 9.81}});
        if (content.images && i % 10 == 5) {
            rng.fill(image, cv::RNG::UNIFORM, 0, 255);
            writer.write(ImageMessage{t, image.clone()});
        }
    }
    writer.finish();
}

class Cli : public ::testing::Test {
 protected:
    ProgramResult run(const std::string& arguments) {
        return vio_slam(arguments, folder_.path().string());
    }

    std::string rawlog(const Content& content) {
        const std::string file = folder_ / "input.rawlog";
        write_rawlog(file, content);
        return file;
    }

    std::string truncated_rawlog() {
        const std::string file = rawlog({});
        std::filesystem::resize_file(file, std::filesystem::file_size(file) / 2);
        return file;
    }

    void expect_error(const std::string& arguments, const std::vector<std::string>& words) {
        expect_one_line(run(arguments), words, arguments);
    }

    std::string output() const { return " --output " + folder_ / "out"; }

    ScratchFolder folder_;
};

TEST_F(Cli, HelpOfEveryCommandGoesToStandardOutput) {
    for (const char* command : {"", "run", "import", "import asl", "track", "simulate", "slow",
                                "sheet", "evaluate", "render", "info", "statistics"}) {
        const ProgramResult result = run(std::string(command) + " --help");
        EXPECT_EQ(result.exit_code, 0) << command;
        EXPECT_NE(result.out.find("--help"), std::string::npos) << command;
        EXPECT_EQ(result.err, "") << command;
    }
    EXPECT_EQ(run("--version").out.rfind("vio-slam ", 0), 0u);
}

TEST_F(Cli, WrongUseIsOneLine) {
    expect_error("", {"command"});
    expect_error("fly", {"fly"});
    expect_error("run --estimator magic x.rawlog" + output(), {"--estimator", "magic"});
    expect_error("run x.rawlog", {"--output"});
    expect_error("run --set tracker.no_such_option=1 --print-options", {"no_such_option"});
    expect_error("evaluate x", {"--against"});
    expect_error("run x.rawlog --from 3 --to 2" + output(), {"--from", "--to"});
}

// What was probably meant, and the help of the command that was understood so far.
TEST_F(Cli, WrongUseIsToldWithARemedy) {
    expect_error("rnu x.rawlog", {"rnu: no such command", "did you mean run?", "vio-slam --help"});
    expect_error("fly", {"there are run, import, "});
    expect_error("import euroc x", {"euroc: no such command", "asl, tum-vi", "import --help"});
    expect_error("calibrate",
                 {"vio-slam calibrate: name one of imu, camera, imu-camera, mirror; "});
    expect_error("run x.rawlog --outptu x",
                 {"--outptu: no such option", "did you mean --output?", "vio-slam run --help"});
    expect_error("info x.rawlog second", {"second: one argument too many"});
    expect_error("info", {"RAWLOG is required; see vio-slam info --help"});
    expect_error("run --set iekf.gat=0.9 --print-options", {"did you mean iekf.gate?"});
}

TEST_F(Cli, MissingFile) {
    const std::string gone = folder_ / "gone";
    write_text(folder_ / "truth.tum", "0 0 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n2 1 1 0 0 0 0 1\n");
    expect_error("run " + gone + output(), {gone});
    expect_error("statistics " + gone, {gone});
    expect_error("run " + rawlog({}) + " --config " + gone + output(), {gone});
    expect_error("run " + rawlog({}) + " --calibration " + gone + output(), {gone});
    expect_error("import asl " + gone + " -o " + folder_ / "x.rawlog", {gone});
    expect_error("simulate " + gone + " -o " + folder_ / "x.rawlog", {gone});
    expect_error("sheet " + gone + " -o " + folder_ / "x.png", {gone});
    expect_error("slow " + gone + " -o " + folder_ / "x.rawlog", {gone});
    expect_error("track " + gone + " -o " + folder_ / "x.rawlog", {gone});
    expect_error("evaluate " + gone + " --against " + folder_ / "truth.tum", {gone});
    expect_error("evaluate " + folder_ / "truth.tum" + " --against " + gone, {gone});
    expect_error("render " + gone + " -o " + folder_ / "x.png", {gone});
    expect_error("info " + gone, {gone});
    EXPECT_FALSE(std::filesystem::exists(folder_ / "x.rawlog"));
    EXPECT_FALSE(std::filesystem::exists(folder_ / "x.png"));
}

TEST_F(Cli, TruncatedRawlog) {
    const std::string file = truncated_rawlog();
    expect_error("run " + file + output(), {file});
    expect_error("info " + file, {file});
    write_text(folder_ / "truth.tum", "0 0 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n2 1 1 0 0 0 0 1\n");
    expect_error("evaluate " + folder_ / "truth.tum" + " --against " + folder_ / "truth.tum" +
                     " --rawlog " + file,
                 {file});
}

// Rows of a path that bends, from time t on, written by the layout of TUM.
std::string tum_rows(double t, int n, double scale = 1) {
    std::string text;
    for (int i = 0; i < n; ++i)
        text += std::to_string(t + 0.1 * i) + " " + std::to_string(scale * std::cos(0.2 * i)) +
                " " + std::to_string(scale * std::sin(0.2 * i)) + " 0 0 0 0 1\n";
    return text;
}

TEST_F(Cli, EvaluateTellsBadTrajectories) {
    const std::string good = folder_ / "good.tum", bad = folder_ / "bad.tum";
    write_text(good, tum_rows(100, 30));
    const auto expect = [&](const std::string& text, const std::vector<std::string>& words) {
        write_text(bad, text);
        expect_error("evaluate " + good + " --against " + bad, words);
    };
    expect(tum_rows(500, 30), {bad, "no overlap in time", "clocks"});
    expect(tum_rows(100, 1), {bad, "only one pose"});
    expect(tum_rows(100, 5) + "100.6 nan 0 0 0 0 0 1\n", {bad, "(line 6)"});
    expect(tum_rows(100, 5) + "100.2 0 0 0 0 0 0 1\n", {bad, "(line 6)", "time stamp"});
    expect("100 0 0 0 0 0 0 1\n101 1 0 0 0 0 0 1\n102 2 0 0 0 0 0 1\n", {bad, "straight line"});
    expect("1 2 3\n", {bad, "(line 1)"});
    expect("", {bad, "no poses"});
    write_text(bad, "100 0 0 0 0 0 0 1\n101 1 0 0 0 0 0 1\n102 2 0 0 0 0 0 1\n");
    expect_error("evaluate " + good + " --align sim3 --against " + bad, {bad, "straight line"});
    expect_error("evaluate " + good + " --against " + rawlog({}), {":odometry", ":gps"});
    expect_error("evaluate " + good + " --against " + rawlog({}) + ":gps", {"no GPS fix"});
    expect_error("evaluate " + good + " --against " + rawlog({}) + ":odometry", {"no odometry"});
    expect_error("evaluate " + good + " --against " + good + " --tracked 1 2 3 4", {"--tracked"});
}

TEST_F(Cli, EvaluateRefusesTruthInOtherUnits) {
    write_text(folder_ / "metres.tum", tum_rows(100, 30));
    write_text(folder_ / "millimetres.tum", tum_rows(100, 30, 1000));
    const std::string command =
        "evaluate " + folder_ / "metres.tum" + " --against " + folder_ / "millimetres.tum";
    expect_error(command, {"millimetres.tum", "seem to be in millimetres", "give both in metres"});
    // An estimate may have no scale: then it is a note.
    const ProgramResult result = run(command + " --align sim3");
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_NE(result.out.find("seem to be in millimetres"), std::string::npos) << result.out;
    std::string nanoseconds = tum_rows(100, 30);
    nanoseconds.replace(0, 3, "1403636579763555584");
    write_text(folder_ / "ns.tum", nanoseconds);
    expect_error("evaluate " + folder_ / "metres.tum" + " --against " + folder_ / "ns.tum",
                 {"ns.tum", "(line 1)", "nanoseconds"});
}

TEST_F(Cli, EvaluateSetsSeveralResultsBesideEachOther) {
    for (const char* name : {"a.tum", "b.tum", "truth.tum"})
        write_text(folder_ / name, tum_rows(100, 30));
    const ProgramResult result = run("evaluate " + folder_ / "a.tum" + " " + folder_ / "b.tum" +
                                     " --against " + folder_ / "truth.tum");
    EXPECT_EQ(result.exit_code, 0) << result.err;
    for (const char* name : {"a.tum", "b.tum", "truth.tum", "position [m]"})
        EXPECT_NE(result.out.find(name), std::string::npos) << result.out;
}

// Six seconds of feature tracks: quick to simulate and to estimate from.
std::string small_scenario() {
    return std::string(VIO_SOURCE_DIR) + "/datasets/perspective_arm.ini";
}

TEST_F(Cli, SweepRunsEveryCombinationOnceAndResumes) {
    const std::string config = folder_ / "sweep.ini", out = folder_ / "sweep";
    write_text(config, "[sweep]\nsimulate = " + small_scenario() +
                           " --set images.render=false --set scenario.seed={seed}\n"
                           "run = --estimator iekf --set iekf.prefix_images={prefix}\n"
                           "evaluate = --align sim3\naverage = seed\n"
                           "[vary]\nprefix = 40 nonsense\nseed = 1..2\n");
    const ProgramResult list = run("sweep " + config + " -o " + out + " --list");
    EXPECT_EQ(list.exit_code, 0) << list.err;
    EXPECT_EQ(std::count(list.out.begin(), list.out.end(), '\n'), 4) << list.out;
    const ProgramResult result = run("sweep " + config + " -o " + out);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    // A row for each prefix: the second one's runs fail, and say why.
    EXPECT_NE(result.out.find("| 40 "), std::string::npos) << result.out;
    EXPECT_NE(result.out.find("| nonsense |    2 |      2 |"), std::string::npos) << result.out;
    EXPECT_NE(result.out.find("prefix_images"), std::string::npos) << result.out;
    EXPECT_EQ(run("sweep " + config + " -o " + out + " --list").out, "")
        << "nothing is left to run";
    EXPECT_EQ(run("sweep " + config + " -o " + out).out, result.out);
    EXPECT_FALSE(read_text(out + "/sweep.csv").empty());
}

TEST_F(Cli, SweepRunsAgainWhatAChangedFileTakesPartIn) {
    const std::string config = folder_ / "sweep.ini", out = folder_ / "sweep";
    write_text(folder_ / "base.ini", "[scenario]\ninclude = " + small_scenario() + "\n");
    write_text(folder_ / "arm.ini", "[scenario]\ninclude = base.ini\n");
    write_text(config, "[sweep]\nsimulate = " + folder_ / "arm.ini" +
                           " --set images.render=false\nrun = --estimator iekf --set "
                           "iekf.prefix_images={prefix}\n[vary]\nprefix = 40\n");
    const auto waiting = [&] {
        const std::string lines = run("sweep " + config + " -o " + out + " --list").out;
        return std::count(lines.begin(), lines.end(), '\n');
    };
    EXPECT_EQ(run("sweep " + config + " -o " + out).exit_code, 0);
    EXPECT_EQ(waiting(), 0);
    write_text(folder_ / "base.ini",
               "[scenario]\ninclude = " + small_scenario() + "\n[tracks]\nnoise = 1\n");
    EXPECT_EQ(waiting(), 1);
}

TEST_F(Cli, SweepTellsBadConfigurations) {
    const std::string config = folder_ / "sweep.ini", out = " -o " + folder_ / "sweep";
    expect_error("sweep " + config + out, {config, "no such file"});
    write_text(config, "[sweep]\nfly = yes\n");
    expect_error("sweep " + config + out, {config, "(line 2)", "fly"});
    write_text(config, "[sweep]\nrun = x\n");
    expect_error("sweep " + config + out, {config, "simulate or rawlog"});
    write_text(config, "[sweep]\nrawlog = x.rawlog\n");
    expect_error("sweep " + config + out, {config, "truth"});
    write_text(config, "[sweep]\nsimulate = x.ini\naverage = seed\n");
    expect_error("sweep " + config + out, {config, "seed"});
    expect_error("sweep " + config, {"--output"});
    expect_error("sweep --cell " + folder_ / "gone", {"gone", "cell.json"});
}

TEST_F(Cli, ReproduceTellsBadNamesAndFolders) {
    expect_error("reproduce table9", {"table9"});
    expect_error("reproduce table6 --datasets " + folder_ / "gone", {"gone", "--datasets"});
}

TEST_F(Cli, ReportIsOneFileWithoutReferencesOutOfIt) {
    VIO_SKIP_FOR(std::system("gnuplot --version >/dev/null 2>&1") == 0 ? "" : "no gnuplot");
    const std::string stem = folder_ / "arm";
    ASSERT_EQ(
        run("simulate " + small_scenario() + " --set images.render=false -o " + stem + ".rawlog")
            .exit_code,
        0);
    ASSERT_EQ(run("run " + stem + ".rawlog --estimator iekf" + output()).exit_code, 0);
    const ProgramResult result =
        run("report " + folder_ / "out" + " --against " + stem + ".truth.tum");
    EXPECT_EQ(result.exit_code, 0) << result.err;
    const std::string page = read_text(folder_ / "out" + "/report.html");
    for (const char* part :
         {"Path", "Errors over time", "3 sigma", "gyro bias", "gravity in W", "features used",
          "normalised innovation", "Timing", "prefers-color-scheme:dark", "Options as used"})
        EXPECT_NE(page.find(part), std::string::npos) << part;
    for (const char* reference : {"<link", "<script", "src=\"http", "url(http"})
        EXPECT_EQ(page.find(reference), std::string::npos) << reference;
    expect_error("report " + folder_ / "gone", {"gone", "no results folder"});
    expect_error("render " + folder_ / "out" + " --colour image -o " + folder_ / "x.png",
                 {"no image colours", "--colour"});
}

TEST_F(Cli, ForeignFile) {
    const std::string file = folder_ / "foreign.rawlog";
    write_text(file, "This is no rawlog.\n");
    expect_error("run " + file + output(), {file});
    expect_error("info " + file, {file});
    expect_error("render " + file + " -o " + folder_ / "x.png", {file});
    expect_error("evaluate " + file + " --against " + file, {file});
    expect_error("import asl " + file + " -o " + folder_ / "x.rawlog", {file});
    expect_error("simulate " + file + " -o " + folder_ / "x.rawlog", {file});
}

TEST_F(Cli, TracksInPlaceOfImagesGiveTheSameEstimate) {
    const std::string images = VIO_SOURCE_DIR "/datasets/demo.rawlog";
    const std::string tracks = folder_ / "tracks.rawlog";
    const ProgramResult result = run("track " + images + " -o " + tracks);
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_NE(result.out.find("152 images"), std::string::npos) << result.out;
    expect_error("track " + tracks + " -o " + folder_ / "x.rawlog", {tracks, "no images"});
    expect_error("track " + tracks + " -o " + tracks, {tracks});
    for (const std::string& rawlog : {images, tracks})
        ASSERT_EQ(run("run " + rawlog + " --estimator batch --to 0.7 --output " +
                      folder_ / (rawlog == images ? "a" : "b"))
                      .exit_code,
                  0);
    const std::string a = read_text(folder_ / "a/trajectory.tum");
    EXPECT_FALSE(a.empty());
    EXPECT_EQ(a, read_text(folder_ / "b/trajectory.tum"));
}

// A camera that is stated wrongly, by up to 15 px, 2 degrees and 15 ms, and said to be known no
// better: the estimate finds it, to what it says of itself, and all results tell of it.
TEST_F(Cli, BatchFindsTheCameraWithEverythingElse) {
    const std::string demo = VIO_SOURCE_DIR "/datasets/demo.rawlog";
    write_text(folder_ / "wrong.ini",
               "[camera]\nfx = 880\nfy = 443\ncx = 332\ncy = 115\n"
               "T_B_C = 0.05 0 0.02 0.99984770 0 0.01745241 0\n[imu]\ntime_offset_s = 0.015\n");
    const ProgramResult result =
        run("run " + demo + " --to 2 --estimator batch --calibration " + folder_ / "wrong.ini" +
            " --set batch.intrinsics_sigma=15 --set batch.extrinsics_rotation_sigma=2"
            " --set batch.extrinsics_position_sigma=0.02 --set batch.time_offset_sigma=0.015" +
            output());
    ASSERT_EQ(result.exit_code, 0) << result.err;

    Rig truth = Recording(demo, {}).rig(), stated = truth, found = truth;
    load_calibration(folder_ / "wrong.ini", stated);
    load_calibration(folder_ / "out/calibration.ini", found);
    const auto errors = [&](const Rig& rig) {
        Eigen::VectorXd error(11);
        error << rig.T_I_C().boxminus(truth.T_I_C()), rig.time_offset - truth.time_offset,
            intrinsics(*rig.camera, 4) - intrinsics(*truth.camera, 4);
        return error;
    };
    const Eigen::VectorXd before = errors(stated), after = errors(found);
    const auto rig = nlohmann::json::parse(read_text(folder_ / "out/summary.json")).at("rig");
    ASSERT_EQ(rig.size(), 6u + 1 + 4 + 5) << rig;  // k1 k2 p1 p2 k3
    for (Eigen::Index k = 0; k < after.size(); ++k) {
        const auto& unknown = rig.at(static_cast<std::size_t>(k));
        EXPECT_LT(std::abs(after(k)), 4 * unknown.at("sigma").get<double>()) << unknown;
        if (k >= 3) {
            EXPECT_NEAR(unknown.at("change"), after(k) - before(k), 1e-6) << unknown;
        }
        EXPECT_NE(result.out.find(unknown.at("name").get<std::string>() + " "), std::string::npos)
            << unknown << "\n"
            << result.out;
    }
    EXPECT_LT(after.head<3>().norm(), before.head<3>().norm() / 2);
    for (Eigen::Index k = 6; k < after.size(); ++k)
        EXPECT_LT(std::abs(after(k)), std::abs(before(k)) / 2)
            << rig.at(static_cast<std::size_t>(k));
    EXPECT_NE(result.out.find("\nrig         rotation x "), std::string::npos) << result.out;
}

TEST_F(Cli, RunWithoutImu) {
    const std::string file = rawlog({.imu = false});
    for (const char* estimator : {"batch", "iekf"})
        expect_error("run " + file + " --estimator " + estimator + output(),
                     {file, "no IMU", "--sensors image"});
    EXPECT_EQ(run("info " + file).exit_code, 0);
}

TEST_F(Cli, RunWithoutImages) {
    const std::string file = rawlog({.images = false});
    expect_error("run " + file + output(), {file, "no images", "--camera-label"});
    EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
    std::filesystem::resize_file(file, std::filesystem::file_size(file) / 2);
    expect_error("run " + file + output(), {file, "the file is cut off", "no images"});
    write_rawlog(file, {.images = false});
    EXPECT_EQ(run("info " + file).exit_code, 0);
}

TEST_F(Cli, RunWithoutCalibration) {
    const std::string file = rawlog({.calibration = false});
    expect_error("run " + file + output(), {file, "not calibrated", "--calibration FILE"});
    EXPECT_EQ(run("info " + file).exit_code, 0);
}

TEST_F(Cli, RunWithUnknownLabel) {
    const std::string file = rawlog({});
    expect_error("run " + file + " --camera-label left" + output(), {file, "left"});
    expect_error("run " + file + " --imu-label xsens" + output(), {file, "xsens"});
}

TEST_F(Cli, RunKeepsResultsThatAreThere) {
    std::filesystem::create_directories(folder_ / "out");
    write_text(folder_ / "out/trajectory.tum", "0 0 0 0 0 0 0 1\n");
    expect_error("run " + rawlog({}) + output(), {folder_ / "out", "overwrite"});
    EXPECT_EQ(read_text(folder_ / "out/trajectory.tum"), "0 0 0 0 0 0 0 1\n");
}

TEST_F(Cli, APartBeyondTheRecordingIsToldAndLeavesNothing) {
    const std::string command = "run " + rawlog({}) + " --from 100 -o ";
    expect_error(command + folder_ / "made/deeper/out",
                 {"--from 100 lies beyond the recording's 1.0 s"});
    EXPECT_FALSE(std::filesystem::exists(folder_ / "made"));
    EXPECT_EQ(run(command + folder_ / "made").out, "") << "nothing is judged";
    std::filesystem::create_directories(folder_ / "there");
    expect_error(command + folder_ / "there", {"--from 100"});
    EXPECT_TRUE(std::filesystem::exists(folder_ / "there"));
}

// The camera is chosen alike by every command that reads a recording.
TEST_F(Cli, EveryCommandTakesTheCameraThatIsNamed) {
    const std::string file = folder_ / "two.rawlog", stamps = folder_ / "stamps.tum";
    write_rawlog(folder_ / "left.rawlog", {});
    constexpr TimeNs kStart = 1'600'000'001'005'000'000;
    {
        RawlogWriterOptions right;
        right.camera_label = "right";
        RawlogWriter writer(folder_ / "right.rawlog", calibrated_rig(), right);
        for (int i = 0; i < 3; ++i)
            writer.write(
                ImageMessage{kStart + i * TimeNs{100'000'000}, cv::Mat(48, 64, CV_8UC1, 9)});
        writer.finish();
    }
    // Members of a gzip file may stand behind each other.
    std::ofstream(file, std::ios::binary)
        << read_text(folder_ / "left.rawlog") << read_text(folder_ / "right.rawlog");
    const std::string named = " --camera-label right";
    const ProgramResult exported =
        run("export " + file + " --as asl" + named + " -o " + folder_ / "asl");
    EXPECT_NE(exported.out.find(": 3 images"), std::string::npos) << exported.out << exported.err;
    const ProgramResult slowed = run("slow " + file + named + " -o " + folder_ / "slow.rawlog");
    EXPECT_NE(slowed.out.find(": 3 images"), std::string::npos) << slowed.out << slowed.err;
    EXPECT_NE(run("info " + folder_ / "slow.rawlog").out.find("\nright "), std::string::npos);
    const ProgramResult drawn =
        run("render " + file + named + " --images 3 -o " + folder_ / "tracks.png");
    EXPECT_EQ(drawn.exit_code, 0) << drawn.err;
    std::ofstream poses(stamps);
    for (int i = 0; i < 3; ++i)
        poses << "1600000001." << i << "05 " << i << " " << i * i << " " << i * i * i
              << " 0 0 0 1\n";
    poses.close();
    const ProgramResult judged = run("evaluate " + stamps + " --against " + stamps + " --rawlog " +
                                     file + named + " --json");
    ASSERT_EQ(judged.exit_code, 0) << judged.err;
    EXPECT_EQ(nlohmann::json::parse(judged.out)["completion"]["images"], 3);
}

TEST_F(Cli, PrintedOptionsLoadAgain) {
    const ProgramResult first = run("run --print-options --set batch.max_iterations=17");
    ASSERT_EQ(first.exit_code, 0) << first.err;
    EXPECT_NE(first.out.find("max_iterations = 17"), std::string::npos);
    write_text(folder_ / "options.ini", first.out);
    EXPECT_EQ(run("run --print-options --config " + folder_ / "options.ini").out, first.out);
}

TEST_F(Cli, RenderRefusesWhatItCannotDraw) {
    for (const char* size : {"abc", "10x10", "1281x720", "1280x720x3"})
        expect_error("render x.3Dscene -o x.png --size " + std::string(size), {"--size", size});
    expect_error("render x.rawlog -o " + folder_ / "x.png", {"x.rawlog"});
    expect_error("render " + rawlog({}) + " -o " + folder_ / "x.gif", {"x.gif"});
    expect_error("render " + rawlog({true, false, true}) + " -o " + folder_ / "x.png",
                 {"input.rawlog", "no images"});
}

// Before anything is read: what would have no effect is a mistake.
TEST_F(Cli, RenderRefusesOptionsThatDoNotApply) {
    const std::string tracks = "render x.rawlog -o x.png ", video = "render x.rawlog -o x.mp4 ";
    for (const char* option : {"--view top", "--size 640x480", "--turn 3", "--dark",
                               "--colour image", "--truth nothere.tum"})
        expect_error(tracks + option, {"x.rawlog", std::string(option).substr(0, 5),
                                       "does not apply to a rawlog's feature tracks"});
    for (const char* option : {"--film turntable", "--seconds 3", "--rate 5"})
        expect_error(video + option, {"does not apply to a rawlog's feature tracks"});
    expect_error(video + "--images 4", {"--images does not apply to a video"});
    std::filesystem::create_directories(folder_ / "out");
    const std::string result = "render " + folder_ / "out" + " -o x.png ";
    for (const char* option : {"--from 3", "--to 4", "--images 4", "--calibration c.ini",
                               "--camera-label left", "--imu-label i"})
        expect_error(result + option, {"does not apply to a results folder"});
    expect_error(result + "--film turntable", {"--film does not apply to a picture"});
    for (const char* option : {"--dark", "--truth t.tum", "--colour image", "--from 3"})
        expect_error("render x.3Dscene -o x.png " + std::string(option),
                     {"does not apply to a .3Dscene"});
}

TEST_F(Cli, StatisticsPrintsATablePerScenario) {
    const std::string arm = VIO_SOURCE_DIR "/datasets/perspective_arm.ini";
    const ProgramResult result = run("statistics " + arm + " " + arm + " --set tracks.most=9");
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_NE(result.out.find("| perspective arm | paper | simulated | deviation |"),
              std::string::npos);
    EXPECT_EQ(std::count(result.out.begin(), result.out.end(), '\n'), 2 * 11 + 1) << result.out;
    expect_error("statistics " + arm + " --set tracks.most=few", {"tracks", "most", "few"});
    expect_error("statistics " + arm + " --set scenario.start_time=-1", {"start_time"});
}

TEST_F(Cli, InfoListsStreamsAndCalibration) {
    const ProgramResult result = run("info " + rawlog({}));
    EXPECT_EQ(result.exit_code, 0) << result.err;
    for (const char* word : {"cam0", "imu0", "CObservationImage", "CObservationIMU", "200.00 Hz",
                             "20.00 Hz", "T_B_C", "T_C_B", "model = perspective, width = 64"})
        EXPECT_NE(result.out.find(word), std::string::npos) << word << " is not in\n" << result.out;
}

}  // namespace
}  // namespace vio::test
