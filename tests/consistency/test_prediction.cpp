// Where the recursive estimator expects features in the next image, and how
// sure it is of that.
#include <gtest/gtest.h>

#include "libvio/recursive/iekf.h"
#include "tests/simulated_run.h"

namespace vio {
namespace {

// Errors of all predicted places against the true projections. The errors of an
// image have its six degrees of freedom in common, those within a second are
// alike: 8 runs of 10 s give about 480 independent degrees, whose mean square
// has a standard deviation of 0.065; bounds at four of them.
TEST(IekfPrediction, PlacesOfFeaturesMatchTheirCovariance) {
    double sum = 0, squares_px2 = 0;
    int count = 0, images = 0;
    for (unsigned seed = 1; seed <= 8; ++seed) {
        test::SimulatedRunOptions simulated;
        simulated.seed = seed;
        simulated.seconds = 10;
        simulated.time_offset = 0.02;
        const test::SimulatedRun run = test::simulate_run(simulated);
        constexpr std::size_t kFirst = 10;
        Iekf filter(run.rig, {}, {});
        filter.start(test::sampled_start(run, kFirst, 1000 + seed));
        std::size_t next = kFirst;
        for (const ImuReading& reading : run.readings) {
            filter.add(reading);
            while (next < run.frames.size() &&
                   run.frames[next].t + from_seconds(simulated.time_offset) <= reading.t) {
                const TimeNs t = run.frames[next].t;
                const Pose T_C_W = (run.truth[next].T_W_B * run.rig.T_B_C).inverse();
                for (const PredictedFeature& feature : filter.predict(t)) {
                    const auto point = static_cast<std::size_t>(feature.id);
                    const auto truth =
                        run.rig.camera->project(T_C_W * run.points[run.point_of_feature[point]]);
                    if (!truth) continue;
                    const Eigen::Vector2d e = feature.uv_px - *truth;
                    sum += e.dot(feature.covariance.ldlt().solve(e)) / 2;
                    squares_px2 += e.squaredNorm() / 2;
                    ++count;
                }
                ++images;
                filter.add(run.frames[next++]);
            }
        }
    }
    EXPECT_GT(count, 15 * images);
    EXPECT_GT(sum / count, 0.7);
    EXPECT_LT(sum / count, 1.3);
    // It is worth asking: without it a feature moves by 15 px from image to
    // image.
    EXPECT_LT(std::sqrt(squares_px2 / count), 2);
}

// What the estimator does not know it does not tell.
TEST(IekfPrediction, NothingBeforeTheStartAndForThePast) {
    test::SimulatedRunOptions simulated;
    simulated.seconds = 2;
    const test::SimulatedRun run = test::simulate_run(simulated);
    Iekf filter(run.rig, {}, {});
    EXPECT_TRUE(filter.predict(run.frames[5].t).empty());
    filter.start(test::sampled_start(run, 5, 1));
    std::size_t next = 5;
    for (const ImuReading& reading : run.readings) {
        while (next < run.frames.size() && run.frames[next].t <= reading.t)
            filter.add(run.frames[next++]);
        filter.add(reading);
    }
    EXPECT_FALSE(filter.predict(run.frames.back().t + 50'000'000).empty());
    EXPECT_TRUE(filter.predict(run.frames[6].t).empty());
}

}  // namespace
}  // namespace vio
