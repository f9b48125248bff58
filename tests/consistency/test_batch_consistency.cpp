#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>

#include "tests/scenario_batch.h"

namespace vio {
namespace {

test::SimulatedRun short_run(unsigned seed) {
    test::SimulatedRunOptions simulation;
    simulation.seed = seed;
    simulation.seconds = 3;
    simulation.features = 25;
    return test::simulate_run(simulation);
}

// The errors of the batch estimate are as large as its covariance says, with a robust loss, too:
// mean NEES over seeds inside the 99.9 % bounds of the chi-square distribution.
class BatchConsistencyWithLoss : public ::testing::TestWithParam<const char*> {};

TEST_P(BatchConsistencyWithLoss, ErrorsAgreeWithTheCovariance) {
    constexpr int kSeeds = 30;
    double pose = 0, motion = 0, bias = 0;
    test::LandmarkNees landmarks;
    for (unsigned seed = 1; seed <= kSeeds; ++seed) {
        const test::SimulatedRun run = short_run(seed);
        BatchOptions options;
        options.loss = GetParam();
        options.outlier_sigmas = 0;
        const BatchResult result =
            estimate_batch(test::batch_problem(run), options, test::truth_from(run, {}));
        ASSERT_TRUE(result.report.converged) << result.report.reason;
        const Estimate truth = test::truth_from(run, result.estimate.states.front().T_W_B);
        const StateEstimate& last = result.estimate.states.back();
        const auto nees = [&](int first, int size) {
            return test::state_nees(last, truth.states.back(), first, size);
        };
        pose += nees(0, 6) / kSeeds;
        motion += nees(0, 9) / kSeeds;
        bias += nees(9, 6) / kSeeds;
        landmarks.add(result.estimate, truth);
    }
    const auto bound = [](double dof) { return 3.3 * std::sqrt(2 * dof / kSeeds); };
    EXPECT_NEAR(pose, 6, bound(6));
    EXPECT_NEAR(motion, 9, bound(9));
    EXPECT_NEAR(bias, 6, bound(6));
    // Landmarks of one run are correlated: judged as if each run gave one.
    EXPECT_NEAR(landmarks.mean(), 3, bound(3));
}

INSTANTIATE_TEST_SUITE_P(Losses, BatchConsistencyWithLoss,
                         ::testing::Values("none", "huber", "cauchy"),
                         [](const auto& loss) { return std::string(loss.param); });

// What a loss costs: variances of the last position, most of which images decide, and landmarks'
// NEES, beside those without. (The loss's bare weights would make it 0.84 or 1.38.)
TEST(BatchConsistency, ARobustLossCostsWhatItShould) {
    constexpr int kSeeds = 30;
    constexpr double kCauchy = 0.916;  // E[psi']^2 / E[psi^2] at a width of 2
    double variance[2] = {}, nees[2] = {};
    for (unsigned seed = 1; seed <= kSeeds; ++seed) {
        const test::SimulatedRun run = short_run(seed);
        for (const int robust : {0, 1}) {
            BatchOptions options;
            options.loss = robust ? "cauchy" : "none";
            const BatchResult result =
                estimate_batch(test::batch_problem(run), options, test::truth_from(run, {}));
            ASSERT_TRUE(result.report.converged) << result.report.reason;
            const Estimate truth = test::truth_from(run, result.estimate.states.front().T_W_B);
            variance[robust] +=
                result.estimate.states.back().covariance.block<3, 3>(kPosition, kPosition).trace();
            test::LandmarkNees landmarks;
            landmarks.add(result.estimate, truth);
            nees[robust] += landmarks.mean();
        }
    }
    EXPECT_GT(variance[1] / variance[0], 0.95);
    EXPECT_LT(variance[1] / variance[0], 1.05 / kCauchy);
    EXPECT_NEAR(nees[1] / nees[0], 1, 0.1);
}

// Errors of scale, in standard deviations, over seeds of the crane.
struct ScaleErrors {
    double mean = 0, square = 0;
};

ScaleErrors scale_errors(const std::vector<std::string>& settings, int seeds, int images,
                         const std::string& loss = BatchOptions().loss) {
    ScenarioOptions crane =
        ScenarioOptions::from_file(std::string(VIO_SOURCE_DIR) + "/datasets/crane.ini", settings);
    ScaleErrors errors;
    for (int seed = 1; seed <= seeds; ++seed) {
        crane.seed = seed;
        const test::ScenarioRun run = test::run_scenario(crane, images);
        BatchOptions options;
        options.loss = loss;
        options.sigma_px = run.sigma_px;
        options.gyro_bias_sigma = crane.gyro_bias_sigma;
        options.accel_bias_sigma = crane.accel_bias_sigma;
        const BatchResult result = estimate_batch(run.problem, options, run.truth);
        EXPECT_TRUE(result.report.converged || !result.report.undetermined.empty())
            << seed << ' ' << result.report.reason;
        if (result.estimate.states.empty()) {
            ADD_FAILURE() << seed << ": no states";
            continue;
        }
        const Estimate truth = test::seen_from(run.truth, result.estimate.states.front().T_W_B);
        double along = 0, length2 = 0;
        for (std::size_t i = 0; i < truth.states.size(); ++i) {
            const Eigen::Vector3d p = truth.states[i].T_W_B.p - truth.states.front().T_W_B.p;
            along += p.dot(result.estimate.states[i].T_W_B.p - truth.states.front().T_W_B.p);
            length2 += p.squaredNorm();
        }
        const double error = std::log(along / length2) / result.report.scale_sigma;
        errors.mean += error / seeds;
        errors.square += error * error / seeds;
    }
    return errors;
}

// Where readings' noise is a good part of what they read, a loss that believes images less than
// they deserve makes the motion too large: of this platform's path by 6 %, at 0.36 standard
// deviations more than no loss does.
TEST(BatchConsistency, ARobustLossLeavesScaleAsItIs) {
    const auto mean = [](const std::string& loss) {
        return scale_errors(
                   {"trajectory.shake_angle=0", "trajectory.shake_distance=0", "tracks.noise=0.2"},
                   50, 60, loss)
            .mean;
    };
    EXPECT_NEAR(mean("cauchy"), mean("none"), 0.15);
}

// A platform that hardly swings: what noise seems to tell of scale is half of all. By the normal
// equations alone the mean square would be 3.5.
TEST(BatchConsistency, NoiseIsNotTakenForWhatTellsOfScale) {
    constexpr int kSeeds = 50;
    const ScaleErrors errors = scale_errors(
        {"trajectory.shake_angle=0.05", "trajectory.shake_distance=0.0003"}, kSeeds, 90);
    EXPECT_NEAR(errors.square, 1, 3.3 * std::sqrt(2.0 / kSeeds));
}

// Mean NEES of the last state over seeds of a scenario, with a model that is what made the data.
struct MeanNees {
    double pose = 0, velocity = 0, bias = 0;
};

MeanNees mean_nees(ScenarioOptions scenario, int seeds, int images) {
    MeanNees mean;
    for (int seed = 1; seed <= seeds; ++seed) {
        scenario.seed = seed;
        const test::ScenarioRun run = test::run_scenario(scenario, images);
        BatchOptions options;
        options.sigma_px = run.sigma_px;
        options.gyro_bias_sigma = scenario.gyro_bias_sigma;
        options.accel_bias_sigma = scenario.accel_bias_sigma;
        options.loss = "none";
        options.outlier_sigmas = 0;
        const BatchResult result = estimate_batch(run.problem, options, run.truth);
        EXPECT_TRUE(result.report.converged) << result.report.reason;
        const Estimate truth = test::seen_from(run.truth, result.estimate.states.front().T_W_B);
        const StateEstimate& last = result.estimate.states.back();
        const auto nees = [&](int first, int size) {
            return test::state_nees(last, truth.states.back(), first, size);
        };
        mean.pose += nees(kRotation, 6) / seeds;
        mean.velocity += nees(kVelocity, 3) / seeds;
        mean.bias += nees(kGyroBias, 6) / seeds;
    }
    return mean;
}

void expect_consistent(const MeanNees& mean, int seeds) {
    const auto bound = [&](double dof) { return 3.3 * std::sqrt(2 * dof / seeds); };
    EXPECT_NEAR(mean.pose, 6, bound(6));
    EXPECT_NEAR(mean.velocity, 3, bound(3));
    EXPECT_NEAR(mean.bias, 6, bound(6));
}

// A platform that does not turn: what the accelerometer's bias and gravity are is told apart by the
// prior alone, to some degrees, so that the bias lies on a piece of a sphere that is not flat any
// more (without its curvature the mean NEES of the biases is 16 to 20 here).
TEST(BatchConsistency, HoldsWhereBiasAndGravityAreHardToTellApart) {
    ScenarioOptions crane =
        ScenarioOptions::from_file(std::string(VIO_SOURCE_DIR) + "/datasets/crane.ini");
    crane.first_image_s = 30.6;  // around the first corner, where the motion changes
    crane.accel_bias_sigma = 0.4;
    constexpr int kSeeds = 30;
    expect_consistent(mean_nees(crane, kSeeds, 60), kSeeds);
}

// The same platform as its camera sees it sharply: gravity's direction is known to a degree, the
// path's length to a twentieth, and its direction far better, which turns with gravity (without
// this second order the mean NEES of the poses is 12 here).
TEST(BatchConsistency, HoldsWhereThePathTurnsWithGravity) {
    ScenarioOptions crane =
        ScenarioOptions::from_file(std::string(VIO_SOURCE_DIR) + "/datasets/crane.ini");
    crane.track_model.noise_px /= 30;
    constexpr int kSeeds = 24;
    expect_consistent(mean_nees(crane, kSeeds, 100), kSeeds);
}

TEST(BatchConsistency, HoldsForTheArm) {
    constexpr int kSeeds = 20;
    expect_consistent(mean_nees(ScenarioOptions::from_file(std::string(VIO_SOURCE_DIR) +
                                                           "/datasets/perspective_arm.ini"),
                                kSeeds, 0),
                      kSeeds);
}

// Tracks that end after a second or so, while the camera sets off: of some, noise alone makes the
// distance, at times a short one, from which the images seem to tell the path to fractions of a
// millimetre (with these points the early poses of one of the seeds are off by six standard
// deviations).
TEST(BatchConsistency, ShortTracksDoNotMakePosesLookKnown) {
    constexpr double kFourSigma = 16 + 3;  // of three components
    ScenarioOptions scenario =
        ScenarioOptions::from_file(std::string(VIO_SOURCE_DIR) + "/datasets/stress/base.ini");
    scenario.track_model.loss_rate = 0.0095;
    for (scenario.seed = 15; scenario.seed < 20; ++scenario.seed) {
        const test::ScenarioRun run = test::run_scenario(scenario, 120);
        BatchOptions options;
        options.loss = "none";
        const BatchResult result = estimate_batch(run.problem, options);
        ASSERT_EQ(result.estimate.states.size(), 120u) << result.report.reason;
        const Estimate truth = test::seen_from(run.truth, result.estimate.states.front().T_W_B);
        for (size_t i = 1; i < 120; ++i)
            EXPECT_LT(test::state_nees(result.estimate.states[i], truth.states[i], kPosition, 3),
                      kFourSigma)
                << "seed " << scenario.seed << ", image " << i;
    }
}

ScenarioOptions arm(int seed) {
    ScenarioOptions scenario =
        ScenarioOptions::from_file(std::string(VIO_SOURCE_DIR) + "/datasets/perspective_arm.ini");
    scenario.seed = seed;
    return scenario;
}

// Table 4: on the arm, whose few points are seen badly, images alone are an order of magnitude
// worse than with inertial data, and as good with perfect data: it is the noise that they cannot
// stand.
TEST(PaperClaims, ImagesAloneCannotStandTheArmsNoise) {
    constexpr int kSeeds = 2;
    double both = 0, alone = 0, alone_exact = 0;
    for (int seed = 1; seed <= kSeeds; ++seed)
        for (const bool exact : {false, true}) {
            ScenarioOptions scenario = arm(seed);
            if (exact) scenario.track_model.noise_px = 0;
            test::ScenarioRun run = test::run_scenario(scenario);
            BatchOptions options;
            options.sigma_px = 2;
            options.loss = "none";
            options.outlier_sigmas = 0;
            options.covariances = false;
            const BatchResult fused = estimate_batch(run.problem, options, run.truth);
            run.problem.imu = {};
            options.max_iterations = 60;
            const BatchResult images = estimate_batch(run.problem, options, run.truth);
            ASSERT_FALSE(images.estimate.states.empty()) << images.report.reason;
            (exact ? alone_exact : alone) +=
                test::errors_of(images.estimate, run.truth).position / kSeeds;
            if (!exact) both += test::errors_of(fused.estimate, run.truth).position / kSeeds;
        }
    EXPECT_GT(alone, 10 * both);
    EXPECT_LT(both, 0.01);
    EXPECT_LT(alone_exact, 0.001);
}

// Fig. 8: over four decades of the fixed variances the error stays below 1 % of the path; beyond,
// it does not.
TEST(PaperClaims, FixedVariancesHardlyMatter) {
    constexpr int kSeeds = 2;
    const auto error = [&](double variance) {
        double sum = 0;
        for (int seed = 1; seed <= kSeeds; ++seed) {
            const test::ScenarioRun run = test::run_scenario(arm(seed));
            BatchOptions options = test::paper_options(variance, run.sigma_px);
            options.covariances = false;
            const BatchResult result = estimate_batch(run.problem, options, run.truth);
            if (variance < 1e-3) {
                EXPECT_TRUE(result.report.converged) << variance << result.report.reason;
            }
            sum += test::errors_of(result.estimate, run.truth).position / kSeeds;
        }
        return sum;
    };
    const double tight = error(1e-8), middle = error(1e-6), loose = error(1e-4);
    for (const double e : {tight, middle, loose}) EXPECT_LT(e, 0.03);  // 1 % of the path
    EXPECT_GT(error(1e-3), 2 * loose);
}

// With so loose inertial terms, points that go to infinity can bend the poses until they fit there:
// a blind start must not end with more cost than one from the truth does (1: of a sum of squares in
// units of sigma, less than what one residual adds).
TEST(BlindStart, RecallsPointsFromInfinity) {
    for (const int seed : {2, 3}) {
        const test::ScenarioRun run = test::run_scenario(arm(seed));
        BatchOptions options = test::paper_options(1e-5, run.sigma_px);
        options.covariances = false;
        const BatchResult blind = estimate_batch(run.problem, options),
                          from_truth = estimate_batch(run.problem, options, run.truth);
        ASSERT_TRUE(blind.report.converged) << blind.report.reason;
        EXPECT_NEAR(blind.report.final_cost, from_truth.report.final_cost, 1) << seed;
    }
}

// Two of the paths that are hardest to start on: wrong minima lie near, of more cost.
TEST(BlindStart, LeadsToTheTruthOnPathsThatTurnFar) {
    for (const unsigned seed : {23U, 57U}) {
        const test::SimulatedRun run = test::simulate_run(test::turning_run(270, seed));
        BatchOptions options;
        options.start = "blind";
        options.covariances = false;
        const BatchProblem problem = test::batch_problem(run);
        const BatchResult blind = estimate_batch(problem, options),
                          from_truth = estimate_batch(problem, options, test::truth_of(run));
        ASSERT_TRUE(blind.report.converged) << blind.report.reason;
        // A few far points may settle elsewhere; the wrong minima cost a fifth more.
        EXPECT_LT(blind.report.final_cost, 1.01 * from_truth.report.final_cost) << seed;
        const test::Errors errors = test::errors_of(blind.estimate, test::truth_of(run)),
                           least = test::errors_of(from_truth.estimate, test::truth_of(run));
        EXPECT_LT(errors.position, 1.5 * least.position) << seed;
        EXPECT_LT(errors.rotation, 1.5 * least.rotation) << seed;
    }
}

BatchResult blind_from_images(const test::SimulatedRun& run) {
    BatchOptions options;
    options.start = "blind";
    options.covariances = false;
    return estimate_batch(test::batch_problem(run, false), options);
}

// Images alone have many minima, most of them within a few percent of the least cost. Two paths on
// which a start with all cameras at the origin ends in one of these; and two on which a point with
// two observations ends at a camera's centre.
TEST(BlindStart, LeadsToTheTruthWithImagesAlone) {
    for (const auto& [span, seed] : {std::pair{180, 3U}, {180, 1U}, {180, 10U}, {180, 15U}}) {
        const test::SimulatedRun run = test::simulate_run(test::turning_run(span, seed));
        const BatchResult blind = blind_from_images(run);
        ASSERT_TRUE(blind.report.converged) << blind.report.reason;
        const test::Errors errors = test::errors_of(blind.estimate, test::truth_of(run));
        EXPECT_LT(errors.position, 0.05) << span << ' ' << seed;
        EXPECT_LT(errors.rotation, 0.05) << span << ' ' << seed;
    }
}

// Paths on which the camera sees nothing for a while: what comes after is joined to what was before
// by no point, which any number of starts would hide.
TEST(BlindStart, SaysThatImagesDoNotJoin) {
    for (const unsigned seed : {13U, 17U}) {
        const test::SimulatedRun run = test::simulate_run(test::turning_run(270, seed));
        const BatchResult result = blind_from_images(run);
        EXPECT_FALSE(result.report.converged) << seed;
        EXPECT_NE(result.report.reason.find("not determined"), std::string::npos)
            << seed << result.report.reason;
    }
}

// One observation in ten anywhere in the image. The second path is lost from the first pair of
// images that is tried.
TEST(BlindStart, StandsGrossOutliersWithImagesAlone) {
    for (const unsigned seed : {5U, 13U}) {
        test::SimulatedRunOptions simulation = test::turning_run(180, seed);
        simulation.outliers = 0.1;
        const test::SimulatedRun run = test::simulate_run(simulation);
        const BatchResult blind = blind_from_images(run);
        ASSERT_TRUE(blind.report.converged) << seed << blind.report.reason;
        const test::Errors errors = test::errors_of(blind.estimate, test::truth_of(run));
        EXPECT_LT(errors.position, 0.05) << seed;
        EXPECT_LT(errors.rotation, 0.05) << seed;
    }
}

// The same, on a path where each start leads to another minimum, well determined and wrong by 12
// degrees at best.
TEST(BlindStart, StartsThatDisagreeAreNoResult) {
    test::SimulatedRunOptions simulation = test::turning_run(270, 6);
    simulation.outliers = 0.1;
    const BatchResult blind = blind_from_images(test::simulate_run(simulation));
    EXPECT_FALSE(blind.report.converged);
    EXPECT_TRUE(blind.estimate.states.empty());
    EXPECT_NE(blind.report.reason.find("no two of the starts"), std::string::npos)
        << blind.report.reason;
}

}  // namespace
}  // namespace vio
