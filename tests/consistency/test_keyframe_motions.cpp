// The motions between key-frames are as certain as their covariances say, and more certain than the
// poses themselves (NEES over seeded runs).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "libvio/recursive/iekf.h"
#include "tests/simulated_batch.h"

namespace vio {
namespace {

const StateEstimate& state_at(const std::vector<StateEstimate>& states, TimeNs t) {
    return *std::find_if(states.begin(), states.end(),
                         [t](const StateEstimate& state) { return state.t == t; });
}

struct Sum {
    double nees = 0;
    int motions = 0;
    double sigma_ratio = 0;  ///< position's standard deviation, of the motion over the end's

    void add(const Estimate& estimate, const std::vector<StateEstimate>& truth) {
        const auto& all = estimate.keyframe_motions;
        for (size_t i = 0; i < all.size(); ++i) {
            const RelativeMotion& motion = all[i];
            if (i > 0) {
                EXPECT_EQ(motion.from, all[i - 1].to) << "the chain has a gap";
            }
            const Pose T =
                state_at(truth, motion.from).T_W_B.inverse() * state_at(truth, motion.to).T_W_B;
            const Vector6d e = T.boxminus(motion.T_A_B);
            nees += e.dot(motion.covariance.ldlt().solve(e));
            const auto end = state_at(estimate.states, motion.to).covariance;
            sigma_ratio += std::sqrt(motion.covariance.bottomRightCorner<3, 3>().trace() /
                                     end.block<3, 3>(kPosition, kPosition).trace());
            ++motions;
        }
    }
};

// The motions of one run are nearly independent; bounds as for a tenth of their number.
double bound(int motions) {
    return 4 * std::sqrt(2 * 6 / (0.1 * motions));
}

TEST(KeyframeMotions, OfTheBatchAgreeWithTheirCovariances) {
    Sum sum;
    for (unsigned seed = 1; seed <= 12; ++seed) {
        test::SimulatedRunOptions simulation;
        simulation.seed = seed;
        simulation.seconds = 4;
        simulation.features = 25;
        simulation.longest_track = 12;
        const auto run = simulate_run(simulation);
        BatchOptions options;
        options.loss = "none";
        options.outlier_sigmas = 0;
        const BatchResult result =
            estimate_batch(test::batch_problem(run), options, test::truth_from(run, {}));
        ASSERT_TRUE(result.report.converged) << result.report.reason;
        ASSERT_GE(result.estimate.keyframe_motions.size(), 3u);
        EXPECT_EQ(result.estimate.keyframe_motions.front().from, run.frames.front().t);
        EXPECT_EQ(result.estimate.keyframe_motions.back().to, run.frames.back().t);
        sum.add(result.estimate, run.truth);
    }
    RecordProperty("nees", std::to_string(sum.nees / sum.motions));
    RecordProperty("sigma_ratio", std::to_string(sum.sigma_ratio / sum.motions));
    EXPECT_NEAR(sum.nees / sum.motions, 6, bound(sum.motions));
    EXPECT_LT(sum.sigma_ratio / sum.motions, 0.9);
}

TEST(KeyframeMotions, OfTheFilterAgreeWithTheirCovariances) {
    Sum sum;
    for (unsigned seed = 1; seed <= 6; ++seed) {
        test::SimulatedRunOptions simulation;
        simulation.seed = seed;
        simulation.seconds = 12;
        const auto run = test::simulate_run(simulation);
        constexpr size_t kFirst = 10;
        Iekf filter(run.rig, {}, {});
        filter.start(test::sampled_start(run, kFirst, 1000 + seed));
        size_t next = kFirst;
        for (const ImuReading& reading : run.readings) {
            while (next < run.frames.size() && run.frames[next].t <= reading.t)
                filter.add(run.frames[next++]);
            filter.add(reading);
        }
        filter.finish();
        const auto& motions = filter.estimate().keyframe_motions;
        ASSERT_GE(motions.size(), 10u);
        EXPECT_EQ(motions.front().from, run.frames[kFirst].t);
        EXPECT_EQ(motions.back().to, filter.estimate().states.back().t);
        sum.add(filter.estimate(), run.truth);
    }
    RecordProperty("nees", std::to_string(sum.nees / sum.motions));
    RecordProperty("sigma_ratio", std::to_string(sum.sigma_ratio / sum.motions));
    EXPECT_NEAR(sum.nees / sum.motions, 6, bound(sum.motions));
    EXPECT_LT(sum.sigma_ratio / sum.motions, 0.9);
}

}  // namespace
}  // namespace vio
