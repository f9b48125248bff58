#include <gtest/gtest.h>

#include <fstream>

#include "libvio/base/angles.h"
#include "libvio/base/errors.h"
#include "libvio/io/text.h"
#include "libvio/io/trajectory_io.h"
#include "libvio/simulation/recorded.h"
#include "libvio/simulation/scenario.h"
#include "tests/unit/scratch_folder.h"

namespace vio {
namespace {

using Eigen::Vector3d;

constexpr TimeNs kRecordedStart = 1'400'000'000'123'456'700;
constexpr double kSeconds = 20;
const Vector3d kGravity(0, 0, -9.81);

/// A hand-held motion, readings of a real IMU on it, and what a motion-capture system says of it:
/// in a tilted frame and with errors that vary slowly.
struct Recorded {
    SplineTrajectory truth, measured;
    Rig rig;
    std::vector<TimeNs> times;
    std::vector<ImuReading> readings;
    std::vector<TimedPose> poses;
    ImuBias bias;
};

Recorded recorded(double tilt, double rotation_error, double position_error) {
    Random random(3, "recorded");
    std::vector<Waypoint> waypoints;
    for (double t = -1; t <= kSeconds + 1; t += 0.7)
        waypoints.push_back({t, {so3::exp(0.2 * random.normal3()), 0.15 * random.normal3()}});
    const auto truth = SplineTrajectory::through(waypoints, CurveEnds::kFree);

    std::vector<Waypoint> errors;
    for (double t = -1; t <= kSeconds + 1; t += 0.7)
        errors.push_back(
            {t, {so3::exp(rotation_error * random.normal3()), position_error * random.normal3()}});
    const auto wander = SplineTrajectory::through(errors, CurveEnds::kFree);
    const Eigen::Matrix3d frame = so3::exp({tilt, 0, 0});
    std::vector<Waypoint> measured;
    std::vector<TimedPose> poses;
    for (int i = 0; i <= 20 * kSeconds; ++i) {
        const double t = i / 20.0;
        const Pose T = truth.at(t).T_W_B, e = wander.at(t).T_W_B;
        measured.push_back({t, {frame * T.R * e.R, frame * (T.p + e.p)}});
        poses.push_back({kRecordedStart + from_seconds(t), measured.back().T_W_B});
    }
    Recorded r{truth, SplineTrajectory::along(measured, 0.05), {}, {}, {}, poses, {}};
    r.rig.T_B_I = {so3::exp({0.3, -0.2, 0.1}), {0.04, -0.02, 0.03}};
    r.rig.imu_noise = {1.7e-4, 2e-3, 2e-5, 1e-4, 0};
    for (int i = 5; i <= 20 * kSeconds - 5; ++i)
        r.times.push_back(kRecordedStart + from_seconds(i / 20.0));

    Random jitter(1, "times");
    ImuErrors imu;
    imu.noise = r.rig.imu_noise;
    imu.initial_bias = r.bias = {{0.02, -0.01, 0.03}, {0.1, 0.2, -0.1}};
    r.readings =
        with_errors(ideal_imu(truth, r.rig.T_B_I, kGravity, imu_times(0, kSeconds, 200, 0, jitter)),
                    imu, random)
            .readings;
    for (ImuReading& reading : r.readings) reading.t += kRecordedStart;
    return r;
}

TEST(RecordedPath, ReadingsTakeTheWanderOutOfRecordedAttitudes) {
    const Recorded r = recorded(1 * kDegree, 0.2 * kDegree, 2e-3);
    const ImuSequence imu(r.readings);
    const SmoothedPath path = smooth_path(r.measured, 0.25, r.times, imu, r.rig, 9.81, {});
    // The wander's 30 independent errors of 0.2 degree average to 0.037.
    EXPECT_NEAR(path.tilt, 1 * kDegree, 0.15 * kDegree);
    ASSERT_EQ(path.states.size(), r.times.size());
    // Turns from image to image are those of the truth to the gyro's noise, not the recording's.
    double change2 = 0, recorded2 = 0, tilt2 = 0, velocity2 = 0;
    for (size_t i = 1; i < path.states.size(); ++i) {
        const double t = to_seconds(r.times[i] - kRecordedStart), before = t - 0.05;
        const Motion a = r.truth.at(before), b = r.truth.at(t);
        const Eigen::Matrix3d turn = a.T_W_B.R.transpose() * b.T_W_B.R;
        const auto of = [&](const Pose& p, const Pose& q) {
            return so3::log(turn.transpose() * p.R.transpose() * q.R).squaredNorm();
        };
        change2 += of(path.states[i - 1].T_W_B, path.states[i].T_W_B);
        recorded2 += of(r.measured.at(before).T_W_B, r.measured.at(t).T_W_B);
        // The direction of gravity in the body, and the velocity in the body, need no frame.
        const Eigen::Matrix3d& R = path.states[i].T_W_B.R;
        tilt2 += (R.row(2) - b.T_W_B.R.row(2)).squaredNorm();
        velocity2 +=
            (R.transpose() * path.states[i].v_W - b.T_W_B.R.transpose() * b.v_W).squaredNorm();
    }
    const double n = static_cast<double>(path.states.size() - 1);
    // 1.7e-4 rad/s/sqrt(Hz) over 0.05 s and three axes is 6.6e-5 rad.
    EXPECT_LT(std::sqrt(change2 / n), 7.5e-5);
    EXPECT_GT(std::sqrt(recorded2 / n), 4e-4);
    // Of the recorded tilt (0.2 degree about two axes) the part stays that is constant over the
    // recording: the accelerometer's bias looks the same.
    EXPECT_LT(std::sqrt(tilt2 / n), 0.5 * 0.2 * kDegree);
    EXPECT_LT(std::sqrt(velocity2 / n), 0.01);
    for (const StateEstimate& state : path.states) {
        EXPECT_LT((state.gyro_bias - r.bias.gyro).norm(), 1e-3);
        EXPECT_LT((state.accel_bias - r.bias.accel).norm(), 0.05);
    }
}

TEST(RecordedPath, ConsistencyIsOneForReadingsAsNoisyAsStatedAndLargeForAWanderingPath) {
    const Recorded r = recorded(0, 0.2 * kDegree, 2e-3);
    const ImuSequence imu(r.readings);
    const auto states = [&](const Trajectory& trajectory) {
        std::vector<StateEstimate> result;
        for (const TimeNs t : r.times) {
            const Motion m = trajectory.at(to_seconds(t - kRecordedStart));
            result.push_back({t, m.T_W_B, m.v_W, r.bias.gyro, r.bias.accel});
        }
        return result;
    };
    const auto truth = imu_consistency(states(r.truth), imu, r.rig, kGravity, {1, 4});
    ASSERT_EQ(truth.size(), 2u);
    EXPECT_NEAR(truth[0].window, 0.05, 1e-9);
    for (const ImuConsistency& c : truth)
        EXPECT_NEAR(c.nees, 1, 4 * std::sqrt(2.0 / (9.0 * c.windows))) << c.window;
    EXPECT_GT(imu_consistency(states(r.measured), imu, r.rig, kGravity, {4})[0].nees, 20);
}

ScenarioOptions files_of(const Recorded& r, const test::ScratchFolder& folder) {
    ScenarioOptions options;
    options.recorded_file = folder / "truth.tum";
    write_tum(options.recorded_file, r.poses, "T_W_B");
    options.recorded_imu_file = folder / "imu.csv";
    std::ofstream csv(options.recorded_imu_file);
    csv << "# t,w,a\n";
    for (const ImuReading& reading : r.readings) {
        csv << reading.t;
        for (const double x : reading.gyro) csv << "," << format(x);
        for (const double x : reading.accel) csv << "," << format(x);
        csv << "\n";
    }
    options.imu_pose = "0.04 -0.02 0.03 0 0 0";
    options.camera_pose = "0 0 0 -90 0 -90";
    options.scene = "room";
    options.scene_origin = "0 0 -1.5";
    options.render = false;
    options.tracks = true;
    options.track_model.noise_px = 0;
    options.image_rate = 10;
    options.first_image_s = 0.5;
    options.imu_margin_s = 0.05;
    return options;
}

TEST(RecordedScenario, KeepsTheRecordedReadingsAndStampsAndSeesTheScenePreciselyFromTheTruth) {
    const test::ScratchFolder folder;
    const Recorded r = recorded(0.5 * kDegree, 0.1 * kDegree, 1e-3);
    const Simulation simulation(files_of(r, folder));
    EXPECT_EQ(simulation.image_times().front(), kRecordedStart + from_seconds(0.5));
    size_t k = 0;
    while (r.readings[k].t / 100 * 100 != simulation.imu().front().t) ++k;
    for (const ImuReading& reading : simulation.imu()) {
        EXPECT_EQ(reading.t, r.readings[k].t / 100 * 100);
        EXPECT_EQ(reading.gyro, r.readings[k].gyro);
        EXPECT_EQ(reading.accel, r.readings[k++].accel);
    }
    const ImuSequence imu(simulation.imu());
    EXPECT_TRUE(imu.covers(simulation.image_times().front(), simulation.image_times().back()));
    ASSERT_EQ(simulation.truth().size(), simulation.image_times().size());
    for (size_t i = 0; i < simulation.truth().size(); i += 20) {
        const Pose T_C_W = (simulation.truth()[i].T_W_B * simulation.rig().T_B_C).inverse();
        ASSERT_GT(simulation.tracks().frames[i].features.size(), 20u);
        for (const FeatureObservation& o : simulation.tracks().frames[i].features) {
            const auto uv = simulation.rig().camera->project(
                T_C_W * simulation.tracks().points_W.at(o.feature_id));
            ASSERT_TRUE(uv);
            EXPECT_LT((*uv - o.uv_px).norm(), 1e-6);
        }
    }
}

TEST(RecordedScenario, TakesImageTimesFromAFile) {
    const test::ScratchFolder folder;
    ScenarioOptions options = files_of(recorded(0, 1e-3, 1e-3), folder);
    options.recorded_imu_file.clear();
    options.times_file = folder / "times.txt";
    const std::vector<TimeNs> times{kRecordedStart - 1'000'000'000, kRecordedStart + 1'000'000'017,
                                    kRecordedStart + 1'070'000'000,
                                    kRecordedStart + 90'000'000'000};
    std::ofstream out(options.times_file);
    for (const TimeNs t : times) out << t << "\n";
    out.close();
    const Simulation simulation(options);
    // Those on the path, on the rawlog's tick of 100 ns.
    ASSERT_EQ(simulation.image_times().size(), 2u);
    EXPECT_EQ(simulation.image_times()[0], kRecordedStart + 1'000'000'000);
    EXPECT_EQ(simulation.image_times()[1], kRecordedStart + 1'070'000'000);
}

TEST(RecordedScenario, RefusesReadingsWithoutPathAndReadingsOfAnotherTime) {
    const test::ScratchFolder folder;
    Recorded r = recorded(0, 1e-3, 1e-3);
    ScenarioOptions options = files_of(r, folder);
    options.recorded_file.clear();
    options.first_image_s = 0;
    EXPECT_THROW(Simulation{options}, InputError);
    for (ImuReading& reading : r.readings) reading.t += from_seconds(1000);
    EXPECT_THROW(Simulation{files_of(r, folder)}, InputError);
}

}  // namespace
}  // namespace vio
