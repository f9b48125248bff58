#include <gtest/gtest.h>

#include <numbers>

#include "libvio/base/errors.h"
#include "libvio/geometry/so3.h"
#include "libvio/imu/integration.h"
#include "libvio/simulation/imu_simulator.h"
#include "libvio/simulation/trajectory.h"

namespace vio {
namespace {

using Eigen::Vector3d;

Pose random_pose(Random& random, double metres, double radians) {
    return {so3::exp(radians * random.normal3()), metres * random.normal3()};
}

/// Lively motion: a waypoint every 0.4 s.
SplineTrajectory lively(CurveEnds ends, int points = 12) {
    Random random(3, "waypoints");
    std::vector<Waypoint> waypoints;
    for (int i = 0; i < points; ++i) waypoints.push_back({0.4 * i, random_pose(random, 0.3, 0.3)});
    return SplineTrajectory::through(waypoints, ends);
}

TEST(SplineTrajectory, PassesThroughItsWaypointsAndRestsAtItsEnds) {
    Random random(5, "waypoints");
    std::vector<Waypoint> waypoints;
    double t = 2;
    for (int i = 0; i < 7; ++i, t += random.uniform(0.3, 1.2))
        waypoints.push_back({t, random_pose(random, 1, 0.5)});
    const auto trajectory = SplineTrajectory::through(waypoints, CurveEnds::kAtRest);
    for (const Waypoint& w : waypoints)
        EXPECT_LT(trajectory.at(w.t).T_W_B.boxminus(w.T_W_B).norm(), 1e-12);
    for (const double end : {trajectory.begin(), trajectory.end()}) {
        const Motion m = trajectory.at(end);
        EXPECT_LT(m.v_W.norm() + m.a_W.norm() + m.omega_B.norm() + m.alpha_B.norm(), 1e-10);
    }
    EXPECT_LT(trajectory.at(t + 100).T_W_B.boxminus(waypoints.back().T_W_B).norm(), 1e-12);
}

// Fourth-order central differences: truncation is below 1e-8 of these curves' fifth derivatives.
template <typename F>
auto difference(const F& f, double t) {
    constexpr double h = 1e-3;
    return ((8 * (f(t + h) - f(t - h)) - (f(t + 2 * h) - f(t - 2 * h))) / (12 * h)).eval();
}

TEST(SplineTrajectory, DerivativesMatchCentralDifferences) {
    for (const CurveEnds ends : {CurveEnds::kAtRest, CurveEnds::kFree}) {
        const auto trajectory = lively(ends);
        for (double t = 0.05; t < 4.3; t += 0.0717) {
            const Motion m = trajectory.at(t);
            const auto position = [&](double s) -> Vector3d { return trajectory.at(s).T_W_B.p; };
            const auto velocity = [&](double s) -> Vector3d { return trajectory.at(s).v_W; };
            const auto rate = [&](double s) -> Vector3d { return trajectory.at(s).omega_B; };
            const auto rotation = [&](double s) -> Vector3d {
                return so3::log(m.T_W_B.R.transpose() * trajectory.at(s).T_W_B.R);
            };
            EXPECT_LT((m.v_W - difference(position, t)).norm(), 1e-6) << t;
            EXPECT_LT((m.a_W - difference(velocity, t)).norm(), 1e-5) << t;
            EXPECT_LT((m.omega_B - difference(rotation, t)).norm(), 1e-6) << t;
            EXPECT_LT((m.alpha_B - difference(rate, t)).norm(), 1e-5) << t;
        }
    }
}

TEST(SplineTrajectory, SensorOnALeverArmMovesAsTheRigidBodyDoes) {
    Random random(9, "arm");
    const auto trajectory = lively(CurveEnds::kFree);
    const Pose T_B_S = random_pose(random, 0.5, 1);
    const double t = 1.7;
    const auto at = [&](double s) { return moved_to(trajectory.at(s), T_B_S); };
    const auto position = [&](double s) -> Vector3d { return at(s).T_W_B.p; };
    const auto velocity = [&](double s) -> Vector3d { return at(s).v_W; };
    EXPECT_LT((at(t).v_W - difference(position, t)).norm(), 1e-6);
    EXPECT_LT((at(t).a_W - difference(velocity, t)).norm(), 1e-5);
}

TEST(SplineTrajectory, RecordedPathIsFollowedClosely) {
    const auto truth = lively(CurveEnds::kFree);
    std::vector<Waypoint> recorded;
    for (double t = 0.2; t < 4; t += 0.005) recorded.push_back({t, truth.at(t).T_W_B});
    const auto along = SplineTrajectory::along(recorded, 0.05);
    for (double t = 0.3; t < 3.9; t += 0.0137) {
        const Motion a = along.at(t), b = truth.at(t);
        EXPECT_LT(a.T_W_B.boxminus(b.T_W_B).norm(), 1e-5) << t;
        EXPECT_LT((a.a_W - b.a_W).norm(), 0.05) << t;
        EXPECT_LT((a.omega_B - b.omega_B).norm(), 2e-3) << t;
    }
}

TEST(SplineTrajectory, RefusesWaypointsOutOfOrder) {
    EXPECT_THROW(SplineTrajectory::through({{0, {}}, {1, {}}, {1, {}}}, CurveEnds::kFree),
                 InputError);
    EXPECT_THROW(SplineTrajectory::through({{0, {}}}, CurveEnds::kFree), InputError);
}

struct IntegrationError {
    double rotation = 0, position = 0, velocity = 0;  // largest over the sequence
};

/// Ideal readings of the whole trajectory, integrated open loop from image to image at 30 Hz.
IntegrationError integrate_back(const Trajectory& trajectory, const Pose& T_B_I, double rate) {
    const Vector3d g_W(0, 0, -9.81);
    Random random(1, "times");
    std::vector<double> images;
    for (int i = 0; i / 30.0 <= trajectory.end(); ++i) images.push_back(i / 30.0);
    const ImuSequence imu(ideal_imu(
        trajectory, T_B_I, g_W, imu_times(0, images.back(), rate, 0.05 / rate, random), images));
    const Motion first = moved_to(trajectory.at(0), T_B_I);
    InertialState state{first.T_W_B.R, first.T_W_B.p, first.v_W};
    IntegrationError worst;
    for (size_t i = 1; i < images.size(); ++i) {
        const auto segments = imu.segments(from_seconds(images[i - 1]), from_seconds(images[i]));
        for (const ImuSegment& segment : segments.value()) integrate(state, segment, g_W);
        const Motion truth = moved_to(trajectory.at(images[i]), T_B_I);
        worst.rotation =
            std::max(worst.rotation, so3::log(truth.T_W_B.R.transpose() * state.R).norm());
        worst.position = std::max(worst.position, (state.p - truth.T_W_B.p).norm());
        worst.velocity = std::max(worst.velocity, (state.v - truth.v_W).norm());
    }
    return worst;
}

TEST(ImuSimulator, IdealReadingsIntegrateBackToTheTrajectory) {
    Random random(4, "pose");
    const Pose T_B_I = random_pose(random, 0.2, 1);
    const auto trajectory = lively(CurveEnds::kAtRest);
    const IntegrationError fine = integrate_back(trajectory, T_B_I, 2000);
    EXPECT_LT(fine.rotation, 1e-6);
    EXPECT_LT(fine.velocity, 1e-6);
    EXPECT_LT(fine.position, 1e-6);
    const IntegrationError coarse = integrate_back(trajectory, T_B_I, 170);
    EXPECT_LT(coarse.rotation, 1e-5);
    EXPECT_LT(coarse.position, 1e-3);
}

TEST(ImuSimulator, ErrorOfIntegrationDoesNotGrowWithTime) {
    const auto trajectory = lively(CurveEnds::kAtRest, 300);  // two minutes
    const IntegrationError error = integrate_back(trajectory, {}, 200);
    EXPECT_LT(error.rotation, 1e-5);
    EXPECT_LT(error.position, 1e-3);
}

TEST(ImuSimulator, IdealReadingsAreTheInstantaneousOnesUpToTheStep) {
    const auto trajectory = lively(CurveEnds::kFree);
    Random random(1, "times");
    const Vector3d g_W(0, 0, -9.81);
    for (const ImuReading& reading :
         ideal_imu(trajectory, {}, g_W, imu_times(0.2, 4, 500, 2e-4, random))) {
        const Motion m = trajectory.at(to_seconds(reading.t));
        EXPECT_LT((reading.gyro - m.omega_B).norm(), 1e-3);
        EXPECT_LT((reading.accel - m.T_W_B.R.transpose() * (m.a_W - g_W)).norm(), 3e-2);
    }
}

TEST(ImuSimulator, NoiseAndBiasHaveTheStatedCovariance) {
    constexpr int kReadings = 20000;
    constexpr double kRate = 200;
    std::vector<ImuReading> still;
    for (int k = 0; k < kReadings; ++k) still.push_back({from_seconds(k / kRate)});
    ImuErrors errors;
    errors.initial_bias = {{0.1, -0.2, 0.3}, {1, 2, -3}};
    Random random(11, "imu");
    const SimulatedImu imu = with_errors(still, errors, random);
    // Sums of squares of normalised errors: chi-square with 3 (readings) degrees of freedom each.
    double gyro = 0, accel = 0, gyro_walk = 0, accel_walk = 0;
    for (int k = 0; k < kReadings; ++k) {
        const ImuReading& r = imu.readings[k];
        const ImuBias& b = imu.biases[k];
        gyro += (r.gyro - b.gyro).squaredNorm() / (std::pow(1.7e-3, 2) * kRate);
        accel += (r.accel - b.accel).squaredNorm() / (std::pow(2e-2, 2) * kRate);
        if (k == 0) continue;
        const ImuBias& a = imu.biases[k - 1];
        gyro_walk += (b.gyro - a.gyro).squaredNorm() / (std::pow(2e-5, 2) / kRate);
        accel_walk += (b.accel - a.accel).squaredNorm() / (std::pow(3e-3, 2) / kRate);
    }
    const double freedom = 3.0 * kReadings, bound = 4 * std::sqrt(2 * freedom);  // four sigma
    EXPECT_NEAR(gyro, freedom, bound);
    EXPECT_NEAR(accel, freedom, bound);
    EXPECT_NEAR(gyro_walk, freedom, bound);
    EXPECT_NEAR(accel_walk, freedom, bound);
    EXPECT_EQ(imu.biases.front().gyro, errors.initial_bias.gyro);
}

TEST(ImuSimulator, LimitsAndQuantisesEachAxis) {
    ImuErrors errors;
    errors.noise = {0, 0, 0, 0};
    errors.gyro_limit = 2.5;
    errors.accel_step = 0.25;
    errors.accel_gain(0, 0) = 2;
    Random random(1, "imu");
    const SimulatedImu imu =
        with_errors({{0, {3, -4, 1}, {0.6, 0.3, -9.8}}, {1000000}}, errors, random);
    EXPECT_EQ(imu.readings[0].gyro, Vector3d(2.5, -2.5, 1));
    EXPECT_EQ(imu.readings[0].accel, Vector3d(1.25, 0.25, -9.75));
}

}  // namespace
}  // namespace vio
