// vio-slam calibrate: each kind from files to a calibration that `run` takes, and bad input.
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "libvio/calibration/board_detector.h"
#include "libvio/camera/description.h"
#include "libvio/camera/mirror.h"
#include "libvio/io/rawlog_writer.h"
#include "tests/cli/calibrate.h"
#include "tests/mirror_board.h"
#include "tests/simulated_run.h"
#include "tests/wanting.h"

namespace vio::test {
namespace {

TEST_F(Calibrate, BadBoardsAreOneLine) {
    const std::string images = folder_.path().string();
    expect_error("camera " + images + " --board " + folder_ / "none.yaml" + out(), {"none.yaml"});
    expect_error(
        "camera " + images + " --board " + write("a.yaml", "target_type: circlegrid\n") + out(),
        {"a.yaml", "target_type", "circlegrid"});
    expect_error("camera " + images + " --board " +
                     write("b.yaml",
                           "target_type: aprilgrid\ntagCols: 6\ntagRows: 6\ntagSize: -1\n"
                           "tagSpacing: 0.3\n") +
                     out(),
                 {"b.yaml", "tagSize", "positive"});
    expect_error("camera " + images + " --board " +
                     write("c.yaml",
                           "target_type: aprilgrid\ntagCols: 600\ntagRows: 6\ntagSize: 0.1\n"
                           "tagSpacing: 0.3\n") +
                     out(),
                 {"c.yaml", "tagCols"});
    expect_error("camera " + images + " --board " + write("d.csv", "# nothing\n") + out(),
                 {"d.csv"});
}

// The corners of a board as features, and readings of a hand-held IMU.
class CalibrateImuCamera : public Calibrate {
 protected:
    std::string survey(const SimulatedRun& simulated) {
        std::string text = "#id,x,y,z\n";
        for (std::size_t id = 0; id < simulated.point_of_feature.size(); ++id) {
            const Eigen::Vector3d& p = simulated.points[simulated.point_of_feature[id]];
            text += std::to_string(id) + "," + std::to_string(p.x()) + "," + std::to_string(p.y()) +
                    "," + std::to_string(p.z()) + "\n";
        }
        return write("survey.csv", text);
    }
    // Measurements in order of time.
    std::string record(const SimulatedRun& simulated, const Rig& stated, bool imu = true) {
        const std::string file = folder_ / "recording.rawlog";
        RawlogWriter writer(file, stated);
        std::size_t k = 0;
        for (const FeatureFrame& frame : simulated.frames) {
            for (; imu && k < simulated.readings.size() && simulated.readings[k].t <= frame.t; ++k)
                writer.write(simulated.readings[k]);
            writer.write(frame);
        }
        for (; imu && k < simulated.readings.size(); ++k) writer.write(simulated.readings[k]);
        writer.finish();
        return file;
    }
};

TEST_F(CalibrateImuCamera, FindsPlaceAndOffsetAndRunTakesThem) {
    SimulatedRunOptions options;
    options.seconds = 8;
    options.sigma_px = 0.3;
    options.time_offset = 0.012;
    const SimulatedRun simulated = simulate_run(options);
    Rig stated = simulated.rig;
    stated.time_offset = 0;
    Vector6d off;
    off << 0.1, -0.1, 0.1, 0.03, 0.03, -0.03;
    stated.T_B_C = stated.T_B_I * stated.T_I_C().boxplus(off);
    const std::string rawlog = record(simulated, stated), board = survey(simulated);
    const ProgramResult result = run("imu-camera " + rawlog + " --board " + board + out());
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const Vector6d error = written().T_I_C().boxminus(simulated.rig.T_I_C());
    EXPECT_LT(error.head<3>().norm(), 0.005);
    EXPECT_LT(error.tail<3>().norm(), 0.01);
    EXPECT_NEAR(written().time_offset, 0.012, 5e-4);
    const ProgramResult taken =
        vio_slam("run " + rawlog + " --estimator batch --calibration " + folder_ / "out.ini" +
                     " --fiducials " + board + " --output " + folder_ / "result",
                 folder_.path().string());
    EXPECT_EQ(taken.exit_code, 0) << taken.err;
}

TEST_F(CalibrateImuCamera, BadInputIsOneLine) {
    SimulatedRunOptions options;
    options.seconds = 2;
    const SimulatedRun simulated = simulate_run(options);
    const std::string board = survey(simulated);
    const std::string rawlog = record(simulated, simulated.rig, false);
    expect_error("imu-camera " + rawlog + " --board " + board + out(), {rawlog, "IMU"});
    const std::string even = write("even.yaml",
                                   "target_type: 'checkerboard'\ntargetCols: 8\ntargetRows: 6\n"
                                   "rowSpacingMeters: 0.06\ncolSpacingMeters: 0.06\n");
    expect_error("imu-camera " + rawlog + " --board " + even + out(), {"even.yaml", "upside down"});
    record(simulated, simulated.rig);
    const std::string strange = write("strange.csv", "100000,0,0,0\n100001,1,0,0\n");
    expect_error("imu-camera " + rawlog + " --board " + strange + out(), {rawlog, "no corner"});
    expect_error("imu-camera " + folder_ / "none.rawlog" + " --board " + board + out(),
                 {"none.rawlog"});
    Rig uncalibrated = simulated.rig;
    uncalibrated.camera.reset();
    record(simulated, uncalibrated);
    expect_error("imu-camera " + rawlog + " --board " + board + out(), {rawlog, "calibra"});
}

// Of the mirror as it ought to be.
std::string mirror_text() {
    Rig rig;
    rig.camera = mirror_camera();
    return calibration_text(rig);
}

TEST_F(Calibrate, MirrorFromAFileOfTargets) {
    const std::string nominal = write("mirror.ini", mirror_text());
    const MirrorShot shot = mirror_shot(1, 120, 0.1);
    std::string points;
    for (const FeatureObservation& f : shot.frame.features) {
        const Eigen::Vector3d& p = shot.targets.at(f.feature_id).p_W;
        for (const double value : {p.x(), p.y(), p.z(), f.uv_px.x(), f.uv_px.y()})
            points += std::to_string(value) + " ";
        points += "\n";
    }
    const std::string file = write("points.txt", points);
    const ProgramResult result = run("mirror " + file + " --calibration " + nominal + out());
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const Pose found = describe(*written().camera).T_C_M;
    EXPECT_LT((found.R.col(2) - shot.T_C_M.R.col(2)).norm(), 0.1 * 0.01745);
    EXPECT_LT((found.p - shot.T_C_M.p).norm(), 1e-3);

    std::filesystem::remove(folder_ / "out.ini");
    const std::string end = " --calibration " + nominal + out();
    expect_error("mirror " + folder_ / "none.txt" + end, {"none.txt"});
    expect_error("mirror " + write("short.txt", "1 2 3 4\n") + end, {"short.txt", "line 1"});
    expect_error("mirror " + write("text.txt", "1 2 3 4 five\n") + end, {"text.txt", "line 1"});
    expect_error("mirror " + write("few.txt", "1 0 0 300 200\n0 1 0 350 200\n") + end,
                 {"few.txt", "six targets"});
    expect_error("mirror " + file + " --calibration " +
                     write("lens.ini",
                           "[camera]\nmodel = perspective\nwidth = 640\nheight = 480\n"
                           "fx = 500\nfy = 500\ncx = 320\ncy = 240\n") +
                     out(),
                 {"lens.ini", "mirror"});
    expect_error("mirror " + file + " --camera-pose 0 0 0 0 0 0 2" + end, {"unit length"});
}

TEST_F(Calibrate, MirrorFromImagesOfAnAprilGrid) {
    VIO_SKIP_FOR(BoardDetector::knows_april_grids() ? "" : "built without AprilTag");
    MirrorBoard mirror(1);
    const std::string images = folder_ / "images";
    std::filesystem::create_directory(images);
    for (int k = 0; k < 4; ++k)
        cv::imwrite(images + "/" + std::to_string(k) + ".png", mirror.shoot().image);
    const std::string end = " --board " +
                            write("target.yaml",
                                  "target_type: 'aprilgrid'\ntagCols: 5\ntagRows: 4\n"
                                  "tagSize: 0.088\ntagSpacing: 0.3\n") +
                            " --calibration " + write("mirror.ini", mirror_text()) + out();
    const ProgramResult result = run("mirror " + images + end);
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const Pose found = describe(*written().camera).T_C_M;
    EXPECT_LT((found.R.col(2) - mirror.T_C_M().R.col(2)).norm(), 0.1 * 0.01745) << result.out;
    EXPECT_LT((found.p - mirror.T_C_M().p).norm(), 1e-3) << result.out;

    std::filesystem::remove(folder_ / "out.ini");
    cv::imwrite(folder_ / "small.png", cv::Mat(240, 320, CV_8UC1, cv::Scalar(128)));
    expect_error("mirror " + folder_ / "small.png" + end, {"small.png", "no corner"});
    expect_error("mirror " + images + end + " --camera-pose 0 0 0 0 0 0 1", {"single image"});
}

}  // namespace
}  // namespace vio::test
