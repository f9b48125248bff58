#include <gtest/gtest.h>

#include "libvio/batch/normal_equations.h"
#include "libvio/batch/objective.h"
#include "libvio/batch/start.h"
#include "libvio/calibration/camera_calibration.h"
#include "libvio/calibration/imu_camera.h"
#include "libvio/camera/fisheye.h"
#include "libvio/camera/intrinsics.h"
#include "tests/board_images.h"
#include "tests/simulated_batch.h"
#include "tests/unit/scratch_folder.h"

namespace vio {
namespace {

using namespace batch;

// The points that features show are surveyed.
BatchProblem surveyed_problem(const test::SimulatedRun& run) {
    BatchProblem problem = test::batch_problem(run);
    for (std::size_t id = 0; id < run.point_of_feature.size(); ++id)
        problem.fiducials[static_cast<FeatureId>(id)].p_W = run.points[run.point_of_feature[id]];
    return problem;
}

test::SimulatedRun run_with(unsigned seed, double seconds, double sigma_px, double time_offset) {
    test::SimulatedRunOptions options;
    options.seed = seed;
    options.seconds = seconds;
    options.sigma_px = sigma_px;
    options.time_offset = time_offset;
    return test::simulate_run(options);
}

struct Linearized {
    Model model;
    std::unique_ptr<NormalEquations> equations;
    Border border;
    double cost = 0;
};

Linearized linearized(const BatchProblem& problem, const Rig& rig, const State& state,
                      const RigUnknowns& unknowns, const BatchOptions& options) {
    Linearized l;
    l.model = make_model(problem, options, static_cast<int>(problem.frames.size()));
    set_rig(l.model, problem, rig);
    l.equations = std::make_unique<NormalEquations>(l.model, make_layout(l.model, options));
    Objective objective(l.model, options, {});
    l.cost = objective.linearize(state, *l.equations).total();
    l.border = objective.linearize_rig(state, unknowns, *l.equations);
    return l;
}

Rig moved(const Rig& rig, int component, double d) {
    Rig next = rig;
    if (component < 6) {
        Vector6d step = Vector6d::Zero();
        step(component) = d;
        next.T_B_C = rig.T_B_I * rig.T_I_C().boxplus(step);
    } else if (component == 6) {
        next.time_offset += d;
    } else {
        Eigen::VectorXd values = intrinsics(*rig.camera, 9);
        values(component - 7) += d;
        next.camera = with_intrinsics(*rig.camera, values);
    }
    return next;
}

// Columns of the border are the rates at which the other unknowns' gradient changes (exactly so
// where residuals are zero), its gradient is half of the cost's.
TEST(RigTerms, BorderMatchesCentralDifferences) {
    // Ideal readings, so fast that what integration leaves out does not matter.
    test::SimulatedRunOptions ideal;
    ideal.seconds = 1.5;
    ideal.imu_hz = 2000;
    ideal.sigma_px = 0;
    ideal.time_offset = 0.01;
    ideal.noise = {0, 0, 0, 0, 0};
    auto run = test::simulate_run(ideal);
    run.rig.imu_noise = test::SimulatedRunOptions().noise;
    const BatchProblem problem = surveyed_problem(run);
    BatchOptions options;
    options.threads = 1;
    const RigUnknowns unknowns{true, true, 9};
    Model model = make_model(problem, options, static_cast<int>(problem.frames.size()));
    const State state = given_start(model, test::truth_of(run));
    const Linearized at = linearized(problem, run.rig, state, unknowns, options);
    for (int k = 0; k < unknowns.count(); ++k) {
        const double h = k < 7 ? 1e-5 : k < 11 ? 1e-2 : 1e-5;
        const auto plus = linearized(problem, moved(run.rig, k, h), state, unknowns, options),
                   minus = linearized(problem, moved(run.rig, k, -h), state, unknowns, options);
        const Eigen::VectorXd reduced =
            (plus.equations->gradient - minus.equations->gradient) / (2 * h);
        Eigen::VectorXd points(at.border.points.rows());
        for (std::size_t j = 0; j < at.equations->b.size(); ++j)
            points.segment<3>(3 * static_cast<Eigen::Index>(j)) =
                (plus.equations->b[j] - minus.equations->b[j]) / (2 * h);
        // Border points' part stands in both.
        Eigen::VectorXd expected = at.border.reduced.col(k);
        for (std::size_t j = 0; j < at.equations->b.size(); ++j)
            if (const int slot = at.equations->layout().border_of_point[j]; slot >= 0)
                expected.segment<3>(
                    at.equations->matrix.offset(at.equations->layout().border_block(slot))) +=
                    at.border.points.col(k).segment<3>(3 * static_cast<Eigen::Index>(j));
        // The offset's rates are those of motion at constant rates and forces between readings.
        const double tolerance = k == 6 ? 2e-2 : 1e-4;
        EXPECT_LT((reduced - expected).norm(), tolerance * expected.norm()) << k;
        EXPECT_LT((points - at.border.points.col(k)).norm(),
                  tolerance * at.border.points.col(k).norm() + 1e-6)
            << k;
        const double gradient = (plus.border.gradient(k) - minus.border.gradient(k)) / (2 * h);
        EXPECT_NEAR(gradient, at.border.H(k, k), tolerance * at.border.H(k, k)) << k;
        const double slope = (plus.cost - minus.cost) / (4 * h);
        EXPECT_NEAR(slope, at.border.gradient(k), 1e-3 * std::sqrt(at.border.H(k, k))) << k;
    }
}

// Sum of n runs' NEES is chi-square with 7 n degrees of freedom; bounds of 99.9 %.
TEST(ImuCameraCalibration, ErrorsAreAsLargeAsTheCovarianceSays) {
    constexpr int kRuns = 6;
    double sum = 0;
    for (unsigned seed = 1; seed <= kRuns; ++seed) {
        const auto run = run_with(seed, 4, 0.5, 0.02);
        BatchProblem problem = surveyed_problem(run);
        Random random(seed, "start");
        Vector6d off;
        off << 0.17 * random.normal3().normalized(), 0.05 * random.normal3().normalized();
        problem.rig.T_B_C = run.rig.T_B_I * run.rig.T_I_C().boxplus(off);
        problem.rig.time_offset = 0;
        ImuCameraOptions options;
        options.batch.sigma_px = 0.5;
        options.batch.loss = "none";
        options.batch.outlier_sigmas = 0;
        const RigCalibration c = calibrate_imu_camera(problem, options);
        EXPECT_TRUE(c.converged) << c.reason;
        Eigen::Matrix<double, 7, 1> error;
        error << run.rig.T_I_C().boxminus(c.rig.T_I_C()), run.rig.time_offset - c.rig.time_offset;
        sum += error.dot(c.covariance.ldlt().solve(error));
    }
    const double expected = 7 * kRuns;
    EXPECT_NEAR(sum, expected, 3.3 * std::sqrt(2 * expected));
}

TEST(ImuCameraCalibration, FindsTheIntrinsicsToo) {
    const auto run = run_with(5, 5, 0.3, -0.015);
    BatchProblem problem = surveyed_problem(run);
    const Eigen::VectorXd truth = intrinsics(*run.rig.camera, 8);
    Eigen::VectorXd off(8);
    off << 6, -5, 4, -7, 0.02, -0.02, 1e-3, -1e-3;
    problem.rig.camera = with_intrinsics(*run.rig.camera, truth + off);
    ImuCameraOptions options;
    options.intrinsics = 8;
    const RigCalibration c = calibrate_imu_camera(problem, options);
    const Eigen::VectorXd error = intrinsics(*c.rig.camera, 8) - truth;
    // Chi-square of 8 degrees of freedom at 99.9 %.
    EXPECT_LT(error.dot(c.covariance.bottomRightCorner(8, 8).ldlt().solve(error)), 26.1);
    EXPECT_NEAR(c.sigma_px, 0.3, 0.03);
}

TEST(ImuCameraCalibration, RefusesWhatDoesNotTell) {
    test::SimulatedRunOptions options;
    options.seconds = 4;
    options.rotation = [](double t) { return so3::exp({0, 0, 0.5 * std::sin(t)}); };
    const BatchProblem one_axis = surveyed_problem(test::simulate_run(options));
    EXPECT_NE(test::error_of([&] { calibrate_imu_camera(one_axis); }).find("one axis"),
              std::string::npos);
    BatchProblem problem = surveyed_problem(run_with(1, 2, 0.5, 0));
    problem.frames.resize(5);
    EXPECT_NE(test::error_of([&] { calibrate_imu_camera(problem); }).find("images show"),
              std::string::npos);
}

// Corners with white noise in place of images.
std::vector<FeatureFrame> views(const Camera& camera, const Board& board, int count, double sigma,
                                unsigned seed, double nearest, double farthest) {
    Random random(seed, "corners");
    std::vector<FeatureFrame> frames;
    const double width = board.points.rbegin()->second.p_W.x(),
                 height = board.points.rbegin()->second.p_W.y();
    for (const Pose& T_G_C :
         test::poses_before(width, height, true, count, nearest, farthest, seed)) {
        FeatureFrame frame{static_cast<TimeNs>(frames.size()) * 1'000'000'000, {}};
        for (const auto& [id, point] : board.points) {
            const auto uv = camera.project(T_G_C.inverse() * point.p_W);
            if (uv && camera.inside_image(*uv, 2) && camera.ray(*uv))
                frame.features.push_back({id, *uv + sigma * random.normal2()});
        }
        frames.push_back(frame);
    }
    return frames;
}

struct Case {
    CameraPtr camera;
    std::string model;
    int distortion;
    double nearest, farthest;
};

std::vector<Case> cases() {
    return {
        {std::make_shared<PerspectiveCamera>(
             PerspectiveParameters{640, 480, 420, 423, 325, 236, {-0.28, 0.08, 3e-4, -2e-4}}),
         "perspective", 4, 0.4, 0.9},
        {std::make_shared<PerspectiveCamera>(
             PerspectiveParameters{640, 480, 600, 603, 315, 246, {-0.15, 0.2, 0, 1e-3, -0.1}}),
         "perspective", 5, 0.6, 1.2},
        {std::make_shared<FisheyeCamera>(
             FisheyeParameters{640, 640, 200, 201, 322, 317, {0.01, -0.008, 2e-3, -3e-4}, 1.6}),
         "fisheye", 4, 0.2, 0.5},
    };
}

// As above, with the number of intrinsics as degrees of freedom.
TEST(CameraCalibration, ErrorsAreAsLargeAsTheCovarianceSays) {
    const Board board = make_april_grid(6, 6, 0.088, 0.3);
    for (const Case& c : cases()) {
        constexpr int kRuns = 6;
        const int n = 4 + c.distortion;
        const Eigen::VectorXd truth = intrinsics(*c.camera, n);
        double sum = 0;
        for (unsigned seed = 1; seed <= kRuns; ++seed) {
            CameraCalibrationOptions options;
            options.model = c.model;
            options.distortion = c.distortion;
            options.width = c.camera->width();
            options.height = c.camera->height();
            options.sigma_px = 0.3;
            const auto frames = views(*c.camera, board, 20, 0.3, seed, c.nearest, c.farthest);
            const CameraCalibration result = calibrate_camera(frames, board, options);
            EXPECT_TRUE(result.rig.converged) << result.rig.reason;
            const Eigen::VectorXd error = intrinsics(*result.rig.rig.camera, n) - truth;
            sum += error.dot(result.rig.covariance.ldlt().solve(error));
        }
        const double expected = n * kRuns;
        EXPECT_NEAR(sum, expected, 3.3 * std::sqrt(2 * expected)) << c.model << c.distortion;
    }
}

TEST(CameraCalibration, PoorCoverageIsToldAndTooLittleRefused) {
    const Case c = cases().front();
    const Board board = make_april_grid(6, 6, 0.02, 0.3);  // small: in the image's middle
    std::vector<FeatureFrame> frames;
    for (int k = 0; k < 6; ++k) {
        FeatureFrame frame{k * 1'000'000'000LL, {}};
        Pose T_G_C;
        T_G_C.R = so3::exp({0.15 * std::sin(k), 0.15 * std::cos(k), 0.3 * k}) *
                  Eigen::Vector3d(1, -1, -1).asDiagonal();
        T_G_C.p = Eigen::Vector3d(0.07, 0.07, 0) - T_G_C.R * Eigen::Vector3d(0, 0, 0.4);
        for (const auto& [id, point] : board.points)
            frame.features.push_back({id, *c.camera->project(T_G_C.inverse() * point.p_W)});
        frames.push_back(frame);
    }
    CameraCalibrationOptions options;
    options.distortion = 4;
    options.width = 640;
    options.height = 480;
    const auto warnings = calibrate_camera(frames, board, options).coverage.warnings;
    ASSERT_EQ(warnings.size(), 4u);
    EXPECT_NE(warnings[0].find("move the board"), std::string::npos);
    frames.resize(2);
    EXPECT_NE(test::error_of([&] { calibrate_camera(frames, board, options); }).find("at least 3"),
              std::string::npos);
}

}  // namespace
}  // namespace vio
