// Estimators made by name give what the library's own give, and bear what robots do to them.
#include <gtest/gtest.h>
#include <mrpt/obs/CObservationGPS.h>
#include <mrpt/obs/CObservationImage.h>
#include <mrpt/rtti/CObject.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <set>

#include "libvio/base/errors.h"
#include "libvio/io/mrpt_conversions.h"
#include "libvio/io/sensors.h"
#include "libvio/recursive/iekf.h"
#include "libvio/slam/motion_estimator.h"
#include "tests/simulated_run.h"
#include "tests/unit/scratch_folder.h"

namespace vio {
namespace {

std::shared_ptr<MotionEstimator> made(const std::string& name) {
    return std::dynamic_pointer_cast<MotionEstimator>(mrpt::rtti::classFactory(name));
}

test::SimulatedRun short_run(double seconds = 5) {
    test::SimulatedRunOptions options;
    options.seconds = seconds;
    options.time_offset = 0;
    return test::simulate_run(options);
}

CObservationFeatures observation_of(const FeatureFrame& frame, const Rig& rig) {
    CObservationFeatures features = to_mrpt(frame);
    features.sensorLabel = "cam";
    features.cameraPose = to_mrpt(rig.T_B_C);
    features.cameraParams = to_mrpt(rig.camera);
    return features;
}

mrpt::obs::CObservationIMU observation_of(const ImuReading& reading, const Rig& rig) {
    mrpt::obs::CObservationIMU imu = to_mrpt(reading);
    imu.sensorLabel = "imu";
    imu.sensorPose = to_mrpt(rig.T_B_I);
    return imu;
}

// Each image's features, and each reading, as MRPT's observations, in order of time.
template <typename Use>
void for_each_observation(const test::SimulatedRun& run, Use use) {
    size_t next = 0;
    for (const ImuReading& reading : run.readings) {
        while (next < run.frames.size() && run.frames[next].t <= reading.t)
            use(observation_of(run.frames[next++], run.rig));
        use(observation_of(reading, run.rig));
    }
}

// A filter that starts from its first prefix.
std::shared_ptr<MotionEstimator> follower() {
    auto estimator = made("vio::RecursiveEstimator");
    estimator->set_option("iekf.start_wanted_tilt=1");
    return estimator;
}

std::vector<StateEstimate> path_of(const test::SimulatedRun& run) {
    const auto estimator = follower();
    estimator->keep_path();
    for_each_observation(run, [&](const auto& observation) { estimator->process(observation); });
    estimator->finish();
    return estimator->estimate().states;
}

void expect_same(const std::vector<StateEstimate>& a, const std::vector<StateEstimate>& b) {
    ASSERT_EQ(a.size(), b.size());
    for (size_t i = 0; i < a.size(); ++i) {
        EXPECT_EQ(a[i].t, b[i].t);
        EXPECT_EQ(a[i].T_W_B.boxminus(b[i].T_W_B).norm(), 0) << i;
    }
}

TEST(MotionEstimator, IsMadeByNameAndFollowsObservations) {
    const auto run = short_run();
    const auto estimator = made("vio::RecursiveEstimator");
    ASSERT_TRUE(estimator);
    EXPECT_FALSE(estimator->newest_pose());
    estimator->set_option("iekf.start_wanted_tilt=1");
    estimator->keep_path();
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
    EXPECT_FALSE(newest->lost);
    ASSERT_FALSE(estimator->status().empty());
    EXPECT_NE(estimator->status().front().text.find("started from a prefix"), std::string::npos);
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

// Drivers repeat messages, and other threads overtake them. Within iekf.message_window neither
// changes anything; what comes later is left out and counted, and nothing stops.
TEST(MotionEstimator, TakesMessagesInAnyOrderWithinItsWindow) {
    const auto run = short_run();
    const auto expected = path_of(run);
    const auto estimator = follower();
    estimator->keep_path();
    int repeated = 0, late = 0, reading = 0, image = 0;
    for (size_t k = 0, next = 0; k < run.readings.size(); ++k) {
        // Every image comes 40 ms late, some twice.
        const TimeNs arrival = run.readings[k].t - 40'000'000;
        while (next < run.frames.size() && run.frames[next].t <= arrival) {
            const auto observation = observation_of(run.frames[next++], run.rig);
            estimator->process(observation);
            if (++image % 7 == 0) estimator->process(observation), ++repeated;
        }
        // Every fifth reading comes after the next one, every eleventh twice.
        size_t i = k;
        if (k % 5 == 3 && k + 1 < run.readings.size()) i = k + 1;
        if (k % 5 == 4) i = k - 1;
        const auto observation = observation_of(run.readings[i], run.rig);
        estimator->process(observation);
        if (++reading % 11 == 0) estimator->process(observation), ++repeated;
        // An impostor of the past, now and then.
        if (k > 200 && k % 100 == 0) {
            ImuReading old = run.readings[k - 60];
            old.t += 1'000'000;
            estimator->process(observation_of(old, run.rig));
            ++late;
        }
    }
    while (image < static_cast<int>(run.frames.size()))
        estimator->process(observation_of(run.frames[image++], run.rig));
    estimator->finish();
    EXPECT_GT(late, 5);
    EXPECT_EQ(estimator->left_out().repeated, repeated);
    EXPECT_EQ(estimator->left_out().late, late);
    EXPECT_EQ(estimator->left_out().images, 0);
    expect_same(estimator->estimate().states, expected);
}

TEST(MotionEstimator, NeedsNoWindowForWhatComesInOrder) {
    const auto run = short_run();
    const auto estimator = follower();
    estimator->set_option("iekf.message_window=0");
    estimator->keep_path();
    TimeNs latest = 0;
    double delay = 0;  // of poses after the start [s]
    for_each_observation(run, [&](const mrpt::obs::CObservation& observation) {
        const TimeNs now = from_mrpt(observation.timestamp);
        const TimeNs before = latest;
        estimator->process(observation);
        if (const auto pose = estimator->newest_pose()) latest = from_mrpt(pose->stamp);
        if (before && latest > before) delay = std::max(delay, to_seconds(now - latest));
    });
    estimator->finish();
    EXPECT_EQ(estimator->left_out().late, 0);
    expect_same(estimator->estimate().states, path_of(run));
    EXPECT_GT(delay, 0);
    EXPECT_LE(delay, 0.005) << "an image waits for the next reading at most";
}

// A robot's estimator runs for days: the path is kept on request only.
TEST(MotionEstimator, KeepsTheNewestStateAlone) {
    const auto run = short_run();
    const auto expected = path_of(run);
    const auto estimator = follower();
    size_t states = 0, landmarks = 0, told = 0;
    for_each_observation(run, [&](const auto& observation) {
        estimator->process(observation);
        const Estimate& estimate = estimator->estimate();
        states = std::max(states, estimate.states.size());
        landmarks = std::max(landmarks, estimate.landmarks.size());
        const auto pose = estimator->newest_pose();
        EXPECT_EQ(pose.has_value(), !estimate.states.empty());
        if (!pose) return;
        ++told;
        EXPECT_EQ(from_mrpt(pose->stamp), estimate.states.back().t);
    });
    EXPECT_EQ(states, 1u);
    EXPECT_GT(landmarks, 10u);
    EXPECT_LE(landmarks, static_cast<size_t>(IekfOptions().max_landmarks));
    EXPECT_GT(told, 100u);
    estimator->finish();
    expect_same(estimator->estimate().states, {expected.back()});
}

// As --calibration, which may be repeated: each file overrides those before it, key by key, and may
// complete what the observations tell.
TEST(MotionEstimator, TakesCalibrationFilesOneAfterAnother) {
    const test::ScratchFolder scratch;
    std::ofstream(scratch / "noise.ini") << "[imu]\ngyro_noise_density = 1.7e-4\n"
                                            "accel_noise_density = 2e-3\n";
    std::ofstream(scratch / "gyro.ini") << "[imu]\ngyro_noise_density = 2e-4\n";
    std::ofstream(scratch / "fx.ini") << "[camera]\nfx = 459\n";
    std::ofstream(scratch / "typo.ini") << "[camera]\nfz = 459\n";
    const auto run = short_run();
    const auto estimator = made("vio::RecursiveEstimator");
    for (const char* name : {"noise.ini", "gyro.ini", "fx.ini"})
        estimator->set_calibration(scratch / name);
    const auto give = [&](MotionEstimator& to) {
        to.process(observation_of(run.frames[0], run.rig));
        to.process(observation_of(run.readings[0], run.rig));
    };
    give(*estimator);
    EXPECT_EQ(estimator->rig().imu_noise.gyro_noise_density, 2e-4);
    EXPECT_EQ(estimator->rig().imu_noise.accel_noise_density, 2e-3);
    const Eigen::Vector3d p_C(0.1, 0, 1);
    EXPECT_NEAR(estimator->rig().camera->project(p_C)->x(), 376 + 45.9, 1e-9);

    const auto mistaken = made("vio::RecursiveEstimator");
    mistaken->set_calibration(scratch / "typo.ini");
    const std::string message = test::error_of([&] { give(*mistaken); });
    EXPECT_NE(message.find("typo.ini [camera] fz"), std::string::npos) << message;
}

// Why the estimator did not start, with what was measured and the limit that it missed.
TEST(MotionEstimator, SaysAtTheEndWhyItHasNoPose) {
    const auto run = short_run(4);  // then the attitude alone would go on
    const auto message_of = [&](const std::string& name, std::vector<std::string> options) {
        const auto estimator = made(name);
        options.emplace_back("iekf.start_velocity_sigma=1e-3");
        for (const std::string& option : options) estimator->set_option(option);
        for_each_observation(run, [&](const auto& o) { estimator->process(o); });
        EXPECT_FALSE(estimator->newest_pose());
        const std::string message = test::error_of([&] { estimator->finish(); });
        EXPECT_EQ(message.empty(), estimator->newest_pose().has_value());
        return message;
    };
    const std::string filter = message_of("vio::RecursiveEstimator", {});
    EXPECT_NE(filter.find("no pose could be estimated: not started: prefix velocity uncertain"),
              std::string::npos)
        << filter;
    EXPECT_NE(filter.find("limit 0.001 m/s"), std::string::npos) << filter;

    // A batch estimate that is to start from it says the same; `auto` grows one from a prefix.
    const std::string batch = message_of("vio::BatchEstimator", {"batch.start=iekf"});
    EXPECT_NE(batch.find("the recursive estimator gave no start: not started: prefix velocity"),
              std::string::npos)
        << batch;
    EXPECT_EQ(message_of("vio::BatchEstimator", {"batch.start=auto"}), "");
}

// The estimator keeps the last entries of its status alone; the log misses none.
TEST(MotionEstimator, LogsWithoutEnd) {
    const auto estimator = follower();
    int logged = 0;
    estimator->logRegisterCallback([&](std::string_view, mrpt::system::VerbosityLevel,
                                       std::string_view, mrpt::Clock::time_point) { ++logged; });
    const auto run = short_run();
    for_each_observation(run, [&](const auto& observation) { estimator->process(observation); });
    ASSERT_TRUE(estimator->newest_pose());
    // Then readings with a gap between any two, of which each is told.
    FeatureFrame frame{run.readings.back().t, {}};
    ImuReading reading = run.readings.back();
    constexpr int kGaps = 10'100;
    for (int i = 0; i < kGaps; ++i) {
        frame.t += 200'000'000;
        reading.t = frame.t + 50'000'000;
        estimator->process(observation_of(frame, run.rig));
        estimator->process(observation_of(reading, run.rig));
    }
    ASSERT_EQ(estimator->status().size(), 10'000u);
    EXPECT_EQ(estimator->status().back().number, logged - 1);
    EXPECT_GT(logged, 10'050);
}

TEST(MotionEstimator, MarksPosesThatCoast) {
    auto run = short_run();
    const TimeNs dark = run.frames[80].t, light = dark + 600'000'000;
    const auto estimator = follower();
    for (FeatureFrame& frame : run.frames)
        if (frame.t >= dark) frame.features.clear();
    bool lost = false;
    for_each_observation(run, [&](const auto& observation) {
        estimator->process(observation);
        const auto pose = estimator->newest_pose();
        if (!pose) return;
        const TimeNs t = from_mrpt(pose->stamp);
        if (t < dark || t > light) {
            EXPECT_EQ(pose->lost, t > light);
        }
        lost = pose->lost;
    });
    EXPECT_TRUE(lost);
}

TEST(MotionEstimator, OfTheFilterKnowsTheNewestStateWhenItWasTaken) {
    const auto run = short_run();
    IekfOptions options;
    options.start_wanted_tilt = 1;
    Iekf filter(run.rig, options, {});
    EXPECT_FALSE(filter.newest());
    for (size_t i = 0, next = 0; i < run.readings.size(); ++i) {
        while (next < run.frames.size() && run.frames[next].t <= run.readings[i].t)
            filter.add(run.frames[next++]);
        filter.add(run.readings[i]);
    }
    ASSERT_TRUE(filter.newest());
    const TimeNs t = filter.newest()->t;
    EXPECT_EQ(filter.take().states.back().t, t);
    EXPECT_TRUE(filter.take().states.empty());
    ASSERT_TRUE(filter.newest());
    EXPECT_EQ(filter.newest()->t, t);
}

// A second camera goes by without a trace for each of its images.
TEST(MotionEstimator, RemembersOtherCamerasByName) {
    const auto run = short_run(0.5);
    Sensors sensors;
    sensors.see(observation_of(run.frames[0], run.rig), {});
    for (const FeatureFrame& frame : run.frames) {
        CObservationFeatures other = observation_of(frame, run.rig);
        other.sensorLabel = "right";
        sensors.see(other, {});
    }
    EXPECT_EQ(sensors.camera_label, "cam");
    EXPECT_EQ(sensors.other_cameras, std::set<std::string>{"right"});
}

TEST(MotionEstimator, LeavesOutWhatNoSensorCanHaveMeasuredAndLogsIt) {
    const auto run = short_run();
    const auto estimator = follower();
    std::vector<std::string> warnings, news;
    estimator->logRegisterCallback([&](std::string_view message, mrpt::system::VerbosityLevel level,
                                       std::string_view, mrpt::Clock::time_point) {
        (level == mrpt::system::LVL_WARN ? warnings : news).emplace_back(message);
    });
    int count = 0;
    for_each_observation(run, [&](const auto& observation) {
        estimator->process(observation);
        if (++count % 100 != 0) return;
        auto broken = observation_of(run.readings.front(), run.rig);
        broken.set(mrpt::obs::IMU_WX, std::nan(""));
        estimator->process(broken);
    });
    estimator->finish();
    EXPECT_EQ(estimator->left_out().unusable, count / 100);
    ASSERT_EQ(warnings.size(), static_cast<size_t>(count / 100));
    EXPECT_NE(warnings[0].find("left out: the IMU reading"), std::string::npos) << warnings[0];
    ASSERT_EQ(news.size(), estimator->status().size());
    EXPECT_NE(news[0].find("started from a prefix"), std::string::npos) << news[0];
    EXPECT_TRUE(estimator->newest_pose());
}

mrpt::obs::CObservationImage observation_of(const cv::Mat& image, TimeNs t) {
    mrpt::obs::CObservationImage observation;
    observation.sensorLabel = "cam";
    observation.timestamp = to_mrpt(t);
    observation.image = mrpt::img::CImage(image, mrpt::img::DEEP_COPY);
    return observation;
}

// Images that are not of their calibration's size end the estimate, also those that waited for the
// IMU; one among others that fit is left out, as is one of more bits than the first.
TEST(MotionEstimator, TellsImagesThatAreNotAsTheOthers) {
    const test::ScratchFolder scratch;
    std::ofstream(scratch / "camera.ini")
        << "[camera]\nmodel = perspective\nwidth = 64\nheight = 48\nfx = 60\nfy = 60\n"
           "cx = 32\ncy = 24\n";
    const auto make = [&] {
        const auto estimator = made("vio::RecursiveEstimator");
        estimator->set_calibration(scratch / "camera.ini");
        return estimator;
    };
    const auto image = [](int width, int value) {
        return cv::Mat(48, width, CV_16UC1, cv::Scalar(value));
    };
    const TimeNs t = from_seconds(1000), step = from_seconds(0.05);
    const auto reading = observation_of(ImuReading{t + step, {0, 0, 0}, {0, 0, 9.8}}, Rig());
    const auto mistaken = make();
    mistaken->process(observation_of(image(32, 1000), t));
    const std::string why = test::error_of([&] { mistaken->process(reading); });
    EXPECT_NE(why.find("32x48 px, its calibration 64x48; give the matching"), std::string::npos)
        << why;

    const auto estimator = make();
    estimator->process(observation_of(image(64, 1000), t));  // 10 bits
    estimator->process(reading);
    estimator->process(observation_of(image(32, 1000), t + 2 * step));
    EXPECT_EQ(estimator->left_out().unusable, 1);
    estimator->process(observation_of(image(64, 1024), t + 3 * step));
    EXPECT_EQ(estimator->left_out().unusable, 2);
    estimator->process(observation_of(image(64, 1023), t + 4 * step));
    EXPECT_EQ(estimator->left_out().unusable, 2);
    const auto stated = make();
    stated->set_bit_depth(12);
    stated->process(observation_of(image(64, 1000), t));
    stated->process(observation_of(image(64, 4095), t + 3 * step));
    EXPECT_EQ(stated->left_out().unusable, 0);
    EXPECT_THROW(make()->set_bit_depth(17), InputError);
}

TEST(MotionEstimator, TakesNoOptionsOnceObservationsHaveCome) {
    const auto run = short_run(0.5);
    const auto estimator = made("vio::RecursiveEstimator");
    estimator->process(observation_of(run.frames[0], run.rig));
    const std::vector<std::function<void()>> late = {
        [&] { estimator->set_option("iekf.start_wanted_tilt=1"); },
        [&] { estimator->load_options(VIO_SOURCE_DIR "/share/presets/drone.ini"); },
        [&] { estimator->set_calibration(VIO_SOURCE_DIR "/share/imu/consumer.ini"); },
        [&] { estimator->set_labels("cam", "imu"); },
        [&] { estimator->ignore_imu(); },
        [&] { estimator->keep_path(); }};
    for (const auto& call : late)
        EXPECT_NE(test::error_of(call).find("observations have come already"), std::string::npos);
}

TEST(MotionEstimator, EstimatesFromImagesAlone) {
    const auto run = short_run();
    const auto estimator = made("vio::RecursiveEstimator");
    estimator->ignore_imu();
    for (const FeatureFrame& frame : run.frames) estimator->process(observation_of(frame, run.rig));
    estimator->finish();
    EXPECT_TRUE(estimator->newest_pose());
    EXPECT_FALSE(estimator->estimate().has_scale);
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
