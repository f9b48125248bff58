// The noise of an IMU from a recording at rest, on simulated noise of known densities.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "libvio/base/angles.h"
#include "libvio/calibration/allan_deviation.h"
#include "tests/unit/scratch_folder.h"

namespace vio {
namespace {

using test::error_of;

constexpr double kImuRate = 50;

// White noise and random walk as densities, at kImuRate.
std::vector<double> noise(double density, double walk, size_t count, unsigned seed) {
    std::mt19937_64 rng(seed);
    std::normal_distribution<double> normal;
    std::vector<double> values(count);
    double bias = 0;
    for (double& value : values) {
        bias += walk / std::sqrt(kImuRate) * normal(rng);
        value = bias + density * std::sqrt(kImuRate) * normal(rng);
    }
    return values;
}

// Flicker noise of instability B as a sum of Gauss-Markov processes, one an octave of correlation
// time: each has its largest Allan variance at 1.89 T; equal variances make a plateau.
std::vector<double> flicker(double instability, size_t count, unsigned seed) {
    std::mt19937_64 rng(seed);
    std::normal_distribution<double> normal;
    std::vector<double> values(count, 0.0);
    for (double T = 0.05; T < 20000; T *= 2) {
        const double decay = std::exp(-1 / (kImuRate * T));
        const double step = std::sqrt(1 - decay * decay);
        double state = normal(rng);
        for (double& value : values) {
            state = decay * state + step * normal(rng);
            value += state;
        }
    }
    // Two-sided power density of one process: 2 s^2 T / (1 + (2 pi f T)^2); of one an octave:
    // s^2 / (2 ln 2 f); of flicker: B^2 / (2 pi f).
    const double scale = instability * std::sqrt(std::numbers::ln2 / std::numbers::pi);
    for (double& value : values) value *= scale;
    return values;
}

TEST(AllanDeviation, OfAlternatingReadingsIsKnown) {
    // Pairs differ by 2; means of two are all alike.
    const auto levels = allan_levels({1, -1, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1}, 0.5);
    ASSERT_EQ(levels.size(), 2u);
    EXPECT_EQ(levels[0].tau, 0.5);
    EXPECT_EQ(levels[0].variance, 2);
    EXPECT_EQ(levels[0].pairs, 8);
    EXPECT_EQ(levels[1].variance, 0);
}

// Errors over the standard deviations that the estimator states, of 40 recordings of 2 h: their
// mean square is 1 within the 99.9 % bounds of chi-square with 40 degrees of freedom.
TEST(AllanDeviation, DensitiesLieWithinTheStatedErrors) {
    constexpr int kRuns = 40;
    constexpr double kDensity = 2e-4, kWalk = 2e-5;
    double density2 = 0, walk2 = 0;
    int flickers = 0;
    for (unsigned seed = 0; seed < kRuns; ++seed) {
        const auto levels = allan_levels(
            noise(kDensity, kWalk, static_cast<size_t>(7200 * kImuRate), seed), 1 / kImuRate);
        const AllanFit fit = fit_allan(levels);
        EXPECT_TRUE(fit.random_walk.determined) << seed;
        flickers += fit.bias_instability.determined;
        if (fit.bias_instability.determined) continue;
        density2 += std::pow((fit.noise_density.value - kDensity) / fit.noise_density.sigma, 2);
        walk2 += std::pow((fit.random_walk.value - kWalk) / fit.random_walk.sigma, 2);
    }
    EXPECT_LE(flickers, 3);  // 1 % each: four of forty come once in 1000
    EXPECT_GT(density2 / kRuns, 0.45);
    EXPECT_LT(density2 / kRuns, 1.84);
    EXPECT_GT(walk2 / kRuns, 0.45);
    EXPECT_LT(walk2 / kRuns, 1.84);
}

TEST(AllanDeviation, FlickerIsTold) {
    constexpr double kDensity = 1e-4, kInstability = 1e-4;
    auto values = flicker(kInstability, static_cast<size_t>(7200 * kImuRate), 1);
    const auto white = noise(kDensity, 0, values.size(), 2);
    for (size_t i = 0; i < values.size(); ++i) values[i] += white[i];
    const AllanFit fit = fit_allan(allan_levels(values, 1 / kImuRate));
    EXPECT_TRUE(fit.bias_instability.determined);
    // The sum of octaves stands for flicker to a few per cent.
    EXPECT_NEAR(fit.bias_instability.value, kInstability,
                3 * fit.bias_instability.sigma + 0.05 * kInstability);
    EXPECT_NEAR(fit.noise_density.value, kDensity, 3 * fit.noise_density.sigma + 0.02 * kDensity);
    // Where the flicker has left the white noise behind, the covering walk is not below it.
    const double walk = covering_random_walk(fit);
    const double level = 2 * std::numbers::ln2 / std::numbers::pi * kInstability * kInstability;
    const double tau = kDensity * kDensity / level;
    EXPECT_GT(walk * walk * tau / 3, 0.8 * level);
}

TEST(AllanDeviation, CoveringWalkIsThatOfDataSheets) {
    // ADIS16448: 14.5 deg/h, 0.66 deg/sqrt(h): EuRoC's sensor.yaml states 1.9e-5 rad/s^2/sqrt(Hz).
    AllanFit fit;
    fit.noise_density.value = 0.66 * kDegree / 60;
    fit.bias_instability = {14.5 * kDegree / 3600, 0, 0, true};
    EXPECT_NEAR(covering_random_walk(fit), 1.94e-5, 0.6e-5);
}

std::vector<ImuReading> recording(double seconds, unsigned seed, double walk = 0) {
    const auto count = static_cast<size_t>(seconds * kImuRate);
    std::array<std::vector<double>, 6> axes;
    for (size_t a = 0; a < 6; ++a)
        axes[a] = noise(a < 3 ? 1e-3 : 1e-2, walk, count, 10 * seed + static_cast<unsigned>(a));
    std::vector<ImuReading> readings(count);
    for (size_t i = 0; i < count; ++i) {
        readings[i].t = 1'600'000'000'000'000'000 + static_cast<TimeNs>(i) * 20'000'000;
        for (int a = 0; a < 3; ++a) {
            readings[i].gyro(a) = 0.01 + axes[static_cast<size_t>(a)][i];
            readings[i].accel(a) = (a == 2 ? 9.81 : 0.1) + axes[static_cast<size_t>(a + 3)][i];
        }
    }
    return readings;
}

TEST(ImuNoise, OfARecordingAtRestIsFound) {
    const auto e = estimate_imu_noise(recording(3600, 1, 1e-4));
    EXPECT_TRUE(e.warnings.empty()) << e.warnings.front();
    EXPECT_NEAR(e.rate, kImuRate, 1e-6);
    EXPECT_NEAR(e.noise.gyro_noise_density, 1e-3, 3 * e.gyro.all.noise_density.sigma);
    EXPECT_NEAR(e.noise.accel_noise_density, 1e-2, 3 * e.accel.all.noise_density.sigma);
    EXPECT_NEAR(e.noise.gyro_bias_random_walk, 1e-4, 3 * e.gyro.all.random_walk.sigma);
    EXPECT_NEAR(e.noise.accel_bias_random_walk, 1e-4, 3 * e.accel.all.random_walk.sigma);
    EXPECT_LT(e.gyro.all.noise_density.sigma, 0.01 * 1e-3);
}

TEST(ImuNoise, AShortRecordingGivesABoundAndAWarning) {
    const auto e = estimate_imu_noise(recording(120, 2, 1e-6));
    ASSERT_EQ(e.warnings.size(), 2u);
    EXPECT_NE(e.warnings[0].find("gyro: 119 s are too short"), std::string::npos) << e.warnings[0];
    EXPECT_GT(e.noise.gyro_bias_random_walk, 1e-6);
    EXPECT_NEAR(e.noise.gyro_noise_density, 1e-3, 4 * e.gyro.all.noise_density.sigma);
}

TEST(ImuNoise, MotionIsLeftOut) {
    auto readings = recording(1200, 3);
    const auto from = static_cast<size_t>(400 * kImuRate);
    for (size_t i = from; i < from + 300; ++i) readings[i].gyro.x() += 0.3;
    const auto e = estimate_imu_noise(readings);
    ASSERT_GE(e.warnings.size(), 2u);
    EXPECT_NE(e.warnings[0].find("moved, or jumped"), std::string::npos) << e.warnings[0];
    EXPECT_GT(e.first, readings[from].t);
    EXPECT_GT(to_seconds(e.last - e.first), 780);
    EXPECT_NEAR(e.noise.gyro_noise_density, 1e-3, 4 * e.gyro.all.noise_density.sigma);
}

TEST(ImuNoise, AKnockBelowTheLimitOfRatesIsSeen) {
    auto readings = recording(600, 4);
    // The table is pushed: the tilt changes by a degree.
    for (size_t i = static_cast<size_t>(200 * kImuRate); i < readings.size(); ++i)
        readings[i].accel.x() += 0.17;
    const auto e = estimate_imu_noise(readings);
    ASSERT_FALSE(e.warnings.empty());
    EXPECT_GT(to_seconds(e.first - readings.front().t), 199);
}

TEST(ImuNoise, GapsAreLeftOut) {
    auto readings = recording(600, 5);
    readings.erase(readings.begin() + 5000, readings.begin() + 5100);
    const auto e = estimate_imu_noise(readings);
    ASSERT_FALSE(e.warnings.empty());
    EXPECT_NE(e.warnings[0].find("1 gaps"), std::string::npos) << e.warnings[0];
    EXPECT_GE(e.first, readings[5000].t);
}

TEST(ImuNoise, MotionThroughoutAndTooLittleAreRefused) {
    auto readings = recording(300, 6);
    for (size_t i = 0; i < readings.size(); ++i)
        readings[i].gyro.y() += 0.5 * std::sin(2 * static_cast<double>(i) / kImuRate);
    EXPECT_NE(error_of([&] { estimate_imu_noise(readings); }).find("no minute at rest"),
              std::string::npos);
    EXPECT_NE(error_of([&] { estimate_imu_noise(recording(59, 7)); }).find("shorter than a minute"),
              std::string::npos);
    auto dead = recording(100, 8);
    for (ImuReading& r : dead) r.gyro.z() = 0;
    EXPECT_NE(error_of([&] { estimate_imu_noise(dead); }).find("do not change at all"),
              std::string::npos);
}

}  // namespace
}  // namespace vio
