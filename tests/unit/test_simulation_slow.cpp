// The paper's slow-down: the same path, slower, with the noise of the sensor.
#include <gtest/gtest.h>

#include <fstream>

#include "libvio/base/errors.h"
#include "libvio/imu/integration.h"
#include "libvio/io/recording.h"
#include "libvio/io/text.h"
#include "libvio/io/trajectory_io.h"
#include "libvio/simulation/export.h"
#include "libvio/simulation/slow.h"
#include "tests/unit/scratch_folder.h"

namespace vio {
namespace {

ScenarioOptions scenario() {
    ScenarioOptions options =
        ScenarioOptions::from_file(std::string(VIO_SOURCE_DIR) + "/datasets/perspective_arm.ini");
    options.render = false;
    options.image_count = 40;
    options.time_offset_s = 0.004;
    return options;
}

void set_noise_free(ScenarioOptions& options) {
    options.imu.noise = {1e-15, 1e-15, 1e-15, 1e-15};  // calibrations must be positive
    options.imu.gyro_step = options.imu.accel_step = 0;
    options.gyro_bias_sigma = options.accel_bias_sigma = 0;
}

struct Contents {
    Rig rig;
    std::vector<ImuReading> readings;
    std::vector<FeatureFrame> frames;
    std::vector<TimeNs> times;  // of all messages, in the file's order
};

Contents contents(const std::string& rawlog) {
    Recording recording(rawlog);
    Contents result{recording.rig(), {}, {}, {}};
    while (const auto message = recording.next()) {
        result.times.push_back(std::visit([](const auto& m) { return m.t; }, *message));
        if (const auto* reading = std::get_if<ImuReading>(&*message))
            result.readings.push_back(*reading);
        if (const auto* frame = std::get_if<FeatureFrame>(&*message))
            result.frames.push_back(*frame);
    }
    return result;
}

class Slow : public ::testing::TestWithParam<int> {};

// From the first true state on, with gravity and velocity reduced, to the last true pose.
TEST_P(Slow, NoiseFreeReadingsIntegrateToTheSamePath) {
    const int f = GetParam();
    const test::ScratchFolder folder;
    ScenarioOptions options = scenario();
    set_noise_free(options);
    const Simulation simulation(options);
    write_simulation(simulation, folder / "fast.rawlog");
    const SlowReport report = slow_rawlog(folder / "fast.rawlog", folder / "slow.rawlog", {f});
    EXPECT_EQ(report.feature_frames, 40);
    EXPECT_EQ(report.readings_out, f * (report.readings_in - 1) + 1);

    const Contents slow = contents(folder / "slow.rawlog");
    const ImuSequence imu(slow.readings);
    const auto truth = read_trajectory(folder / "slow.truth.tum");
    ASSERT_EQ(truth.size(), 40u);
    const TimeNs offset = from_seconds(slow.rig.time_offset);
    EXPECT_NEAR(slow.rig.time_offset, 0.004 * f, 1e-12);
    const Eigen::Vector3d g_W = simulation.g_W() * report.gravity_factor;
    const Pose& T_B_I = slow.rig.T_B_I;
    const Motion first = simulation.trajectory().at(0);
    const Motion start = moved_to(first, T_B_I);
    InertialState state{start.T_W_B.R, start.T_W_B.p, start.v_W / f};
    for (size_t i = 1; i < truth.size(); ++i) {
        const auto segments = imu.segments(truth[i - 1].t + offset, truth[i].t + offset);
        for (const ImuSegment& segment : segments.value()) integrate(state, segment, g_W);
        const Pose T_W_I = truth[i].T_W_B * T_B_I;
        // Interpolated readings are off the curve by up to h^2/8 of its second derivative, which
        // at 167 Hz is 4e-6 of the readings' own curvature.
        EXPECT_LT((state.p - T_W_I.p).norm(), 1e-4) << i;
        EXPECT_LT(so3::log(T_W_I.R.transpose() * state.R).norm(), 1e-5) << i;
        EXPECT_EQ(truth[i].t - truth[0].t, f * (simulation.truth()[i].t - simulation.truth()[0].t));
    }
}

INSTANTIATE_TEST_SUITE_P(Factors, Slow, ::testing::Values(2, 4, 8));

TEST(SlowRawlog, KeepsFeaturesAndOrderAndDividesVelocitiesAndBiases) {
    const test::ScratchFolder folder;
    const Simulation simulation(scenario());
    write_simulation(simulation, folder / "fast.rawlog");
    slow_rawlog(folder / "fast.rawlog", folder / "slow.rawlog", {4});
    const Contents fast = contents(folder / "fast.rawlog"), slow = contents(folder / "slow.rawlog");
    EXPECT_TRUE(std::is_sorted(slow.times.begin(), slow.times.end()));
    EXPECT_EQ(slow.times.front(), fast.times.front());
    EXPECT_EQ(slow.times.back() - slow.times.front(), 4 * (fast.times.back() - fast.times.front()));
    ASSERT_EQ(slow.frames.size(), fast.frames.size());
    for (size_t i = 0; i < fast.frames.size(); ++i)
        for (size_t k = 0; k < fast.frames[i].features.size(); ++k)
            EXPECT_EQ(slow.frames[i].features[k].uv_px, fast.frames[i].features[k].uv_px);
    EXPECT_NEAR(slow.rig.imu_noise.gyro_bias_random_walk,
                fast.rig.imu_noise.gyro_bias_random_walk / 8, 1e-15);
    EXPECT_NEAR(slow.rig.imu_noise.accel_bias_random_walk,
                fast.rig.imu_noise.accel_bias_random_walk / 32, 1e-15);
    TextRows before(folder / "fast.truth_states.csv"), after(folder / "slow.truth_states.csv");
    while (before.next()) {
        ASSERT_TRUE(after.next());
        for (size_t i = 1; i < 10; ++i)
            EXPECT_NEAR(after.number(i), before.number(i) / (i < 7 ? 4 : 16), 1e-15);
    }
}

// The noise left by steps 1 to 3 and the noise added: together the sensor's, in every reading.
TEST(ImuSlower, BringsTheNoiseBackToTheSensors) {
    constexpr int kReadings = 20000, kFactor = 4;
    constexpr double kRate = 200;
    const ImuNoise noise;
    const double gyro_sigma = noise.gyro_noise_density * std::sqrt(kRate);
    const double accel_sigma = noise.accel_noise_density * std::sqrt(kRate);
    Random random(8, "readings");
    ImuSlower slower({kFactor}, noise, kRate, 0);
    std::array<double, 2 * kFactor> chi2{};  // by place between recorded readings
    std::array<int, 2 * kFactor> n{};
    for (int k = 0; k < kReadings; ++k) {
        const auto slowed = slower.push({from_seconds(k / kRate), gyro_sigma * random.normal3(),
                                         accel_sigma * random.normal3()});
        for (size_t i = 0; i < slowed.size(); ++i) {
            const size_t place = slowed.size() - 1 - i;
            chi2[place] += slowed[i].gyro.squaredNorm() / (gyro_sigma * gyro_sigma);
            chi2[kFactor + place] += slowed[i].accel.squaredNorm() / (accel_sigma * accel_sigma);
            n[place] += 3, n[kFactor + place] += 3;
        }
    }
    for (size_t i = 0; i < chi2.size(); ++i)
        EXPECT_NEAR(chi2[i], n[i], 4 * std::sqrt(2.0 * n[i])) << i;
}

TEST(SlowRawlog, RefusesBadInput) {
    const test::ScratchFolder folder;
    ScenarioOptions options = scenario();
    options.image_count = 3;
    write_simulation(Simulation(options), folder / "fast.rawlog");
    const auto error = [&](const std::string& in, const std::string& out, int factor) {
        return test::error_of([&] { slow_rawlog(in, out, {factor}); });
    };
    EXPECT_NE(error(folder / "none.rawlog", folder / "slow.rawlog", 2), "");
    EXPECT_NE(error(folder / "fast.rawlog", folder / "slow.rawlog", 1), "");
    EXPECT_NE(error(folder / "fast.rawlog", folder / "fast.rawlog", 2), "");
    EXPECT_FALSE(std::filesystem::exists(folder / "slow.rawlog"));
}

}  // namespace
}  // namespace vio
