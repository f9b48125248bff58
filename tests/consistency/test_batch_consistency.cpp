#include <gtest/gtest.h>

#include <cmath>

#include "tests/simulated_batch.h"

namespace vio {
namespace {

// The errors of the batch estimate are as large as its covariance says: mean NEES over seeds inside
// the 99.9 % bounds of the chi-square distribution.
TEST(BatchConsistency, ErrorsAgreeWithTheCovariance) {
    constexpr int kSeeds = 30;
    double pose = 0, motion = 0, bias = 0, landmarks = 0;
    int landmark_count = 0;
    for (unsigned seed = 1; seed <= kSeeds; ++seed) {
        test::SimulatedRunOptions simulation;
        simulation.seed = seed;
        simulation.seconds = 3;
        simulation.features = 25;
        const auto run = simulate_run(simulation);
        BatchOptions options;
        options.loss = "none";
        options.outlier_sigmas = 0;
        const BatchResult result =
            estimate_batch(test::batch_problem(run), options, test::truth_from(run, {}));
        ASSERT_TRUE(result.report.converged) << result.report.reason;
        const Estimate truth = test::truth_from(run, result.estimate.states.front().T_W_B);
        const StateEstimate& last = result.estimate.states.back();
        const auto e = test::state_error(last, truth.states.back());
        const auto nees = [&](int first, int size) {
            return e.segment(first, size)
                .dot(last.covariance.block(first, first, size, size).inverse() *
                     e.segment(first, size));
        };
        pose += nees(0, 6) / kSeeds;
        motion += nees(0, 9) / kSeeds;
        bias += nees(9, 6) / kSeeds;
        for (const LandmarkEstimate& landmark : result.estimate.landmarks)
            if (landmark.observations > 20) {
                const Eigen::Vector3d d =
                    landmark.p_W - truth.landmarks[static_cast<size_t>(landmark.id)].p_W;
                landmarks += d.dot(landmark.covariance.inverse() * d);
                ++landmark_count;
            }
    }
    const auto bound = [](double dof) { return 3.3 * std::sqrt(2 * dof / kSeeds); };
    EXPECT_NEAR(pose, 6, bound(6));
    EXPECT_NEAR(motion, 9, bound(9));
    EXPECT_NEAR(bias, 6, bound(6));
    // Landmarks of one run are correlated: judged as if each run gave one.
    EXPECT_NEAR(landmarks / landmark_count, 3, bound(3));
}

}  // namespace
}  // namespace vio
