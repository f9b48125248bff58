#include <gtest/gtest.h>

#include "libvio/batch/rig_refinement.h"
#include "libvio/camera/intrinsics.h"
#include "libvio/simulation/random.h"
#include "tests/simulated_batch.h"

namespace vio {
namespace {

constexpr int kIntrinsics = 9;

// What is stated of the rig errs as much as the options say.
BatchOptions options_of_doubt() {
    BatchOptions options;
    options.loss = "none";
    options.outlier_sigmas = 0;
    options.intrinsics_sigma = 4;
    options.extrinsics_rotation_sigma = 0.5;
    options.extrinsics_position_sigma = 0.02;
    options.time_offset_sigma = 0.005;
    return options;
}

// Another rig, drawn from what the options say of this one.
Rig drawn(const Rig& rig, const Eigen::VectorXd& sigmas, Random& random) {
    Eigen::VectorXd off(sigmas.size());
    for (Eigen::Index k = 0; k < off.size(); ++k) off(k) = sigmas(k) * random.normal();
    Rig other = rig;
    other.T_B_C = rig.T_B_I * rig.T_I_C().boxplus(Vector6d(off.head<6>()));
    other.time_offset += off(6);
    other.camera = with_intrinsics(*rig.camera,
                                   intrinsics(*rig.camera, kIntrinsics) + off.tail<kIntrinsics>());
    return other;
}

// A run whose problem states a wrong rig, and options that doubt what is stated or trust it.
struct Doubted {
    Doubted(const test::SimulatedRunOptions& simulation, unsigned seed)
        : run(simulate_run(simulation)),
          problem(test::batch_problem(run)),
          start(test::truth_from(run, {})),
          doubt(options_of_doubt()) {
        doubt.sigma_px = trust.sigma_px = simulation.sigma_px;
        trust.loss = doubt.loss;
        trust.outlier_sigmas = doubt.outlier_sigmas;
        Random random(seed, "rig");
        problem.rig = drawn(run.rig, batch::rig_sigmas(run.rig, doubt), random);
    }

    test::SimulatedRun run;
    BatchProblem problem;
    Estimate start;
    BatchOptions doubt, trust;
};

Eigen::VectorXd rig_error(const Rig& found, const Rig& truth) {
    Eigen::VectorXd error(7 + kIntrinsics);
    error << found.T_I_C().boxminus(truth.T_I_C()), found.time_offset - truth.time_offset,
        intrinsics(*found.camera, kIntrinsics) - intrinsics(*truth.camera, kIntrinsics);
    return error;
}

struct Judged {
    double nees_pose = 0, nees_motion = 0;
    double position = 0;  // of the last state [m]
};

Judged judged(const BatchResult& result, const test::SimulatedRun& run) {
    const Estimate truth = test::truth_from(run, result.estimate.states.front().T_W_B);
    const StateEstimate& last = result.estimate.states.back();
    const auto e = test::state_error(last, truth.states.back());
    const auto nees = [&](int size) {
        return e.head(size).dot(last.covariance.topLeftCorner(size, size).inverse() * e.head(size));
    };
    return {nees(6), nees(9), e.segment<3>(kPosition).norm()};
}

// A rig that is stated wrongly, by as much as it is said to be known: it is found, to its
// covariance, and poses and points are what their covariances say. Mean NEES over seeds inside the
// 99.9 % bounds.
TEST(RigRefinement, ErrorsAgreeWithTheCovariance) {
    constexpr int kSeeds = 20;
    double rig = 0;
    test::LandmarkNees landmarks;
    Judged refined, wrong;
    const auto add = [](Judged& sum, const Judged& one) {
        sum.nees_pose += one.nees_pose / kSeeds;
        sum.nees_motion += one.nees_motion / kSeeds;
        sum.position += one.position * one.position / kSeeds;
    };
    for (unsigned seed = 1; seed <= kSeeds; ++seed) {
        test::SimulatedRunOptions simulation;
        simulation.seed = seed;
        simulation.seconds = 3;
        simulation.features = 40;
        simulation.sigma_px = 0.5;
        simulation.time_offset = 0.02;
        const Doubted one(simulation, seed);
        const test::SimulatedRun& run = one.run;
        add(wrong, judged(estimate_batch(one.problem, one.trust, one.start), run));

        const BatchResult result = estimate_batch(one.problem, one.doubt, one.start);
        ASSERT_TRUE(result.report.converged) << result.report.reason;
        ASSERT_TRUE(result.rig);
        ASSERT_EQ(result.rig->unknowns.size(), 7u + kIntrinsics);
        const Eigen::VectorXd error = rig_error(result.rig->rig, run.rig);
        rig += error.dot(result.rig->covariance.ldlt().solve(error)) / kSeeds;
        add(refined, judged(result, run));
        const Estimate truth = test::truth_from(run, result.estimate.states.front().T_W_B);
        landmarks.add(result.estimate, truth);
    }
    const auto bound = [](double dof) { return 3.3 * std::sqrt(2 * dof / kSeeds); };
    EXPECT_NEAR(rig, 7 + kIntrinsics, bound(7 + kIntrinsics));
    EXPECT_NEAR(refined.nees_pose, 6, bound(6));
    EXPECT_NEAR(refined.nees_motion, 9, bound(9));
    EXPECT_NEAR(landmarks.mean(), 3, bound(3));
    // Three seconds do not tell all of the rig.
    EXPECT_LT(std::sqrt(refined.position), std::sqrt(wrong.position) / 3);
}

// Of the error that a wrong rig makes at the end of the path, hardly anything is left: what is left
// is what the estimate says of itself (inside the 99.9 % bound of the chi-square distribution), and
// that is a tenth at most.
TEST(RigRefinement, TakesTheErrorOfAWrongRigAway) {
    constexpr double kBound6 = 22.46;
    test::SimulatedRunOptions simulation;
    simulation.seconds = 15;
    simulation.sigma_px = 0.5;
    simulation.features = 80;
    const Doubted one(simulation, 1);
    const Judged wrong = judged(estimate_batch(one.problem, one.trust, one.start), one.run);
    const BatchResult result = estimate_batch(one.problem, one.doubt, one.start);
    EXPECT_LT(judged(result, one.run).nees_pose, kBound6);
    const Eigen::Matrix3d C =
        result.estimate.states.back().covariance.block<3, 3>(kPosition, kPosition);
    EXPECT_LT(std::sqrt(C.trace()), wrong.position / 10);
}

}  // namespace
}  // namespace vio
