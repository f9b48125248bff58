// Estimators made by name give what the library's own give.
#include <gtest/gtest.h>
#include <mrpt/obs/CObservationGPS.h>
#include <mrpt/rtti/CObject.h>

#include "libvio/base/errors.h"
#include "libvio/io/mrpt_conversions.h"
#include "libvio/recursive/iekf.h"
#include "libvio/slam/motion_estimator.h"
#include "tests/simulated_run.h"
#include "tests/unit/scratch_folder.h"

namespace vio {
namespace {

std::shared_ptr<MotionEstimator> made(const std::string& name) {
    return std::dynamic_pointer_cast<MotionEstimator>(mrpt::rtti::classFactory(name));
}

test::SimulatedRun short_run() {
    test::SimulatedRunOptions options;
    options.seconds = 5;
    options.time_offset = 0;
    return test::simulate_run(options);
}

// Each image's features, and each reading, as MRPT's observations, in order of time.
template <typename Use>
void for_each_observation(const test::SimulatedRun& run, Use use) {
    size_t next = 0;
    for (const ImuReading& reading : run.readings) {
        while (next < run.frames.size() && run.frames[next].t <= reading.t) {
            CObservationFeatures features = to_mrpt(run.frames[next++]);
            features.sensorLabel = "cam";
            features.cameraPose = to_mrpt(run.rig.T_B_C);
            features.cameraParams = to_mrpt(run.rig.camera);
            use(features);
        }
        mrpt::obs::CObservationIMU imu = to_mrpt(reading);
        imu.sensorLabel = "imu";
        imu.sensorPose = to_mrpt(run.rig.T_B_I);
        use(imu);
    }
}

TEST(MotionEstimator, IsMadeByNameAndFollowsObservations) {
    const auto run = short_run();
    const auto estimator = made("vio::RecursiveEstimator");
    ASSERT_TRUE(estimator);
    EXPECT_FALSE(estimator->newest_pose());
    estimator->set_option("iekf.start_wanted_tilt=1");
    int poses = 0;
    mrpt::Clock::time_point last{};
    for_each_observation(run, [&](const mrpt::obs::CObservation& observation) {
        estimator->process(observation);
        const auto pose = estimator->newest_pose();
        if (pose && pose->stamp != last) ++poses, last = pose->stamp;
    });
    estimator->process(mrpt::obs::CObservationGPS());  // not its business
    estimator->finish();
    EXPECT_GT(poses, 30);

    // The rig of the observations has no noise densities: the built-in ones apply to both.
    Rig rig = run.rig;
    rig.imu_noise = ImuNoise{};
    IekfOptions options;
    options.start_wanted_tilt = 1;
    Iekf filter(rig, options, {});
    size_t next = 0;
    for (const ImuReading& reading : run.readings) {
        while (next < run.frames.size() && run.frames[next].t <= reading.t)
            filter.add(run.frames[next++]);
        filter.add(reading);
    }
    filter.finish();
    const auto &a = estimator->estimate().states, &b = filter.estimate().states;
    ASSERT_EQ(a.size(), b.size());
    // Stamps of MRPT count 100 ns; in that time the camera moves a fifth of a micrometre.
    for (size_t i = 0; i < a.size(); ++i)
        EXPECT_LT(a[i].T_W_B.boxminus(b[i].T_W_B).norm(), 1e-5) << i;
    const auto newest = estimator->newest_pose();
    const PoseWithCovariance pose = from_mrpt(newest->pdf);
    EXPECT_LT(pose.pose.boxminus(a.back().T_W_B).norm(), 1e-12);
    EXPECT_LT((pose.covariance - a.back().covariance.topLeftCorner<6, 6>()).norm(), 1e-12);
}

TEST(MotionEstimator, OfTheBatchAnswersAtTheEnd) {
    const auto run = short_run();
    const auto estimator = made("vio::BatchEstimator");
    ASSERT_TRUE(estimator);
    for_each_observation(run, [&](const auto& observation) { estimator->process(observation); });
    EXPECT_FALSE(estimator->newest_pose());
    estimator->finish();
    EXPECT_EQ(estimator->estimate().states.size(), run.frames.size());
    EXPECT_TRUE(estimator->newest_pose());
}

TEST(MotionEstimator, TakesOptionsAndHandsThemToItsCopies) {
    const auto estimator = made("vio::RecursiveEstimator");
    estimator->set_option("iekf.prefix_images=1000");
    EXPECT_THROW(estimator->set_option("iekf.fly=1"), InputError);
    EXPECT_THROW(estimator->load_options("/nonexistent.ini"), InputError);
    EXPECT_THROW(estimator->set_calibration("/nonexistent.ini"), InputError);
    const auto copy = std::dynamic_pointer_cast<MotionEstimator>(estimator->duplicateGetSmartPtr());
    ASSERT_TRUE(copy);
    for_each_observation(short_run(), [&](const auto& observation) { copy->process(observation); });
    EXPECT_FALSE(copy->newest_pose()) << "still waits for its long prefix";
    EXPECT_THROW(estimator->finish(), InputError) << "has seen nothing";
}

TEST(MotionEstimator, SaysWhichSensorStaysSilent) {
    test::SimulatedRunOptions options;
    options.seconds = 12;
    const auto estimator = made("vio::RecursiveEstimator");
    estimator->set_labels("cam", "other");
    const std::string message = test::error_of([&] {
        for_each_observation(test::simulate_run(options),
                             [&](const auto& observation) { estimator->process(observation); });
    });
    EXPECT_NE(message.find("IMU"), std::string::npos) << message;
    EXPECT_FALSE(made("vio::Nonsense"));
}

}  // namespace
}  // namespace vio
