// vio-slam calibrate camera and imu-camera from rendered images of boards: what they write is as
// near to the truth as the covariance that they print says.
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "libvio/calibration/board_detector.h"
#include "libvio/camera/fisheye.h"
#include "libvio/camera/intrinsics.h"
#include "libvio/camera/perspective.h"
#include "libvio/io/rawlog_writer.h"
#include "tests/board_images.h"
#include "tests/cli/calibrate.h"
#include "tests/simulated_run.h"
#include "tests/wanting.h"

namespace vio::test {
namespace {

constexpr const char* kCheckerboard =
    "target_type: 'checkerboard'\ntargetCols: 8\ntargetRows: 5\n"
    "rowSpacingMeters: 0.06\ncolSpacingMeters: 0.06\n";
constexpr const char* kAprilGrid =
    "target_type: 'aprilgrid'\ntagCols: 5\ntagRows: 4\ntagSize: 0.088\ntagSpacing: 0.3\n";

// The error over the covariance that the program printed; in degrees of freedom where that is
// right.
double nees(const Eigen::VectorXd& error, const std::string& printed) {
    std::istringstream text(
        printed.substr(std::min(printed.size(), printed.find("\ncovariance") + 1)));
    std::string names;
    std::getline(text, names);
    Eigen::MatrixXd covariance(error.size(), error.size());
    for (Eigen::Index i = 0; i < error.size(); ++i)
        for (Eigen::Index j = 0; j < error.size(); ++j) text >> covariance(i, j);
    EXPECT_TRUE(text) << printed;
    return error.dot(covariance.ldlt().solve(error));
}

// Of a chi-square distribution of n degrees of freedom, at 99.9 % (Wilson and Hilferty).
double largest_chi_square(double n) {
    return n * std::pow(1 - 2 / (9 * n) + 3.09 * std::sqrt(2 / (9 * n)), 3);
}

const PerspectiveParameters kLens{480, 360, 390, 391, 244, 176, {-0.2, 0.08, 3e-4, -2e-4}};

struct LensCase {
    const char* model;
    bool april_grid, rawlog;
};

class CalibrateLens : public Calibrate, public ::testing::WithParamInterface<LensCase> {
 protected:
    // A folder of images, or a rawlog without calibration.
    std::string record(const std::vector<cv::Mat>& images, bool rawlog) {
        const std::string file = folder_ / (rawlog ? "images.rawlog" : "images");
        if (!rawlog) {
            std::filesystem::create_directory(file);
            for (size_t k = 0; k < images.size(); ++k)
                cv::imwrite(file + "/" + std::to_string(100 + k) + ".png", images[k]);
            return file;
        }
        RawlogWriter writer(file, Rig{});
        for (size_t k = 0; k < images.size(); ++k)
            writer.write(ImageMessage{
                1'600'000'000'000'000'000 + static_cast<TimeNs>(k) * 100'000'000, images[k]});
        writer.finish();
        return file;
    }
};

TEST_P(CalibrateLens, IsAsNearToTheTruthAsItSays) {
    const LensCase c = GetParam();
    VIO_SKIP_FOR(!c.april_grid || BoardDetector::knows_april_grids() ? ""
                                                                     : "built without AprilTag");
    CameraPtr truth = std::make_shared<PerspectiveCamera>(kLens);
    const bool fisheye = c.model == std::string("fisheye");
    if (fisheye)
        truth = std::make_shared<FisheyeCamera>(
            FisheyeParameters{480, 360, 155, 156, 243, 177, {0.01, -0.008, 2e-3, -3e-4}, 1.5});
    const AprilGridPattern grid;
    const CheckerboardPattern squares;
    const BoardRenderer renderer(*truth, c.april_grid ? static_cast<const Pattern&>(grid) : squares,
                                 3);
    const double near = fisheye ? 0.15 : 0.4, far = fisheye ? 0.35 : 0.8;
    const std::vector<Pose> poses = c.april_grid
                                        ? poses_before(0.55, 0.44, true, 12, near, far, 5)
                                        : poses_before(0.42, 0.24, false, 20, near, far, 2);
    std::vector<cv::Mat> images;
    for (const Pose& T_G_C : poses) images.push_back(renderer.image(T_G_C, images.size()));
    const ProgramResult result =
        run("camera " + record(images, c.rawlog) + " --board " +
            write("target.yaml", c.april_grid ? kAprilGrid : kCheckerboard) + " --model " +
            c.model + " --distortion 4" + out());
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(written().camera->model_name(), c.model);
    const Eigen::VectorXd error = intrinsics(*written().camera, 8) - intrinsics(*truth, 8);
    EXPECT_LT(nees(error, result.out), largest_chi_square(8)) << error.transpose() << "\n"
                                                              << result.out;
}

INSTANTIATE_TEST_SUITE_P(Boards, CalibrateLens,
                         ::testing::Values(LensCase{"perspective", false, false},
                                           LensCase{"perspective", true, true},
                                           LensCase{"fisheye", false, true},
                                           LensCase{"fisheye", true, false}),
                         [](const auto& c) {
                             return std::string(c.param.model) +
                                    (c.param.april_grid ? "AprilGrid" : "Checkerboard") +
                                    (c.param.rawlog ? "Rawlog" : "Folder");
                         });

TEST_F(Calibrate, CameraSaysWhatIsWrongWithImages) {
    const std::string board = write("target.yaml", kCheckerboard);
    const std::string blank = folder_ / "blank";
    std::filesystem::create_directory(blank);
    cv::imwrite(blank + "/1.png", cv::Mat(480, 640, CV_8UC1, cv::Scalar(128)));
    const std::string end = " --board " + board + out();
    expect_error("camera " + blank + end + " --model fisheye --distortion 8", {"fisheye", "4"});
    expect_error("camera " + blank + end, {blank, "no corner"});
    cv::imwrite(blank + "/2.png", cv::Mat(240, 640, CV_8UC1, cv::Scalar(128)));
    expect_error("camera " + blank + end, {"2.png", "640 x 240"});
    expect_error("camera " + folder_ / "nowhere" + end, {"nowhere"});
    const std::string empty = folder_ / "empty";
    std::filesystem::create_directory(empty);
    expect_error("camera " + empty + end, {"empty", "no images"});
}

// One recording of a rig in motion before a board, without any calibration: intrinsics from its
// images, then the rig.
TEST_F(Calibrate, RigFromARawlogOfImages) {
    VIO_SKIP_FOR(BoardDetector::knows_april_grids() ? "" : "built without AprilTag");
    SimulatedRunOptions options;
    options.seconds = 5;
    options.image_hz = 10;
    options.time_offset = 0.013;
    options.features = 0;
    // The board's middle is 0.6 m before the camera, which looks along x.
    options.position = [](double t) -> Eigen::Vector3d {
        return {0.12 * std::sin(3.1 * t), 0.14 * std::sin(2.3 * t + 1), 0.12 * std::sin(2.7 * t)};
    };
    options.rotation = [](double t) -> Eigen::Matrix3d {
        return so3::exp(
            {0.5 * std::sin(2.1 * t), 0.2 * std::sin(2.9 * t + 2), 0.25 * std::sin(2.5 * t + 1)});
    };
    const SimulatedRun simulated = simulate_run(options);
    const PerspectiveCamera camera(kLens);
    const AprilGridPattern pattern;
    const BoardRenderer renderer(camera, pattern, 2);
    Eigen::Matrix3d R_W_G;  // board: x to the right, y up, z to the viewer
    R_W_G << 0, 0, -1, -1, 0, 0, 0, 1, 0;
    const Pose T_W_G{R_W_G, Eigen::Vector3d(0.65, 0.27, -0.22)};

    const std::string rawlog = folder_ / "motion.rawlog";
    Rig unknown;
    unknown.imu_noise = options.noise;
    RawlogWriter writer(rawlog, unknown);
    std::size_t k = 0;
    for (const StateEstimate& state : simulated.truth) {
        for (; k < simulated.readings.size() && simulated.readings[k].t <= state.t; ++k)
            writer.write(simulated.readings[k]);
        const Pose T_G_C = T_W_G.inverse() * state.T_W_B * simulated.rig.T_B_C;
        writer.write(ImageMessage{state.t, renderer.image(T_G_C, k)});
    }
    for (; k < simulated.readings.size(); ++k) writer.write(simulated.readings[k]);
    writer.finish();

    const std::string board = write("target.yaml", kAprilGrid);
    const ProgramResult lens = run("camera " + rawlog + " --board " + board +
                                   " --distortion 4 -o " + folder_ / "camera.ini");
    ASSERT_EQ(lens.exit_code, 0) << lens.err;
    const ProgramResult rig = run("imu-camera " + rawlog + " --board " + board + " --calibration " +
                                  folder_ / "camera.ini" + " --intrinsics" + out());
    ASSERT_EQ(rig.exit_code, 0) << rig.err;
    Eigen::VectorXd error(15);
    error << written().T_I_C().boxminus(simulated.rig.T_I_C()),
        written().time_offset - options.time_offset,
        intrinsics(*written().camera, 8) - intrinsics(camera, 8);
    EXPECT_LT(nees(error, rig.out), largest_chi_square(15)) << error.transpose() << "\n" << rig.out;
}

}  // namespace
}  // namespace vio::test
