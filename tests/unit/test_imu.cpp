#include <gtest/gtest.h>

#include <random>

#include "libvio/geometry/so3.h"
#include "libvio/imu/preintegration.h"
#include "tests/unit/numeric_jacobian.h"

namespace vio {
namespace {

using test::numeric_jacobian;

InertialState boxplus(const InertialState& s, const Vector9d& d) {
    return {s.R * so3::exp(d.head<3>()), s.p + d.segment<3>(3), s.v + d.tail<3>()};
}

Vector9d boxminus(const InertialState& a, const InertialState& b) {
    Vector9d d;
    d << so3::log(b.R.transpose() * a.R), a.p - b.p, a.v - b.v;
    return d;
}

class Imu : public ::testing::Test {
 protected:
    Eigen::Vector3d random(double scale) {
        return scale * Eigen::Vector3d(uniform_(engine_), uniform_(engine_), uniform_(engine_));
    }
    InertialState random_state() { return {so3::exp(random(2)), random(5), random(2)}; }
    std::vector<ImuSegment> random_segments(int n) {
        std::vector<ImuSegment> segments;
        for (int i = 0; i < n; ++i) segments.push_back({0.005, random(2), random(10)});
        return segments;
    }

    std::mt19937 engine_{7};
    std::uniform_real_distribution<double> uniform_{-1, 1};
    const Eigen::Vector3d g_{0, 0, -9.81};
};

TEST_F(Imu, StepJacobianMatchesCentralDifferences) {
    for (const double dt : {0.02, 1.0}) {
        const InertialState start = random_state();
        const ImuSegment segment{dt, random(3), random(10)};
        IntegrationJacobian J;
        InertialState nominal = start;
        integrate(nominal, segment, g_, &J);
        const auto F = numeric_jacobian<9, 9>([&](const Vector9d& d) {
            InertialState s = boxplus(start, d);
            integrate(s, segment, g_);
            return boxminus(s, nominal);
        });
        const auto G_gyro = numeric_jacobian<9, 3>([&](const Eigen::Vector3d& d) {
            InertialState s = start;
            integrate(s, {segment.dt, segment.gyro + d, segment.accel}, g_);
            return boxminus(s, nominal);
        });
        const auto G_accel = numeric_jacobian<9, 3>([&](const Eigen::Vector3d& d) {
            InertialState s = start;
            integrate(s, {segment.dt, segment.gyro, segment.accel + d}, g_);
            return boxminus(s, nominal);
        });
        EXPECT_LT((J.F - F).cwiseAbs().maxCoeff(), 1e-8);
        EXPECT_LT((J.G_gyro - G_gyro).cwiseAbs().maxCoeff(), 1e-8);
        EXPECT_LT((J.G_accel - G_accel).cwiseAbs().maxCoeff(), 1e-8);
    }
}

// However far it turns: angles of 0.005 to 20 rad, one step against many.
TEST_F(Imu, AStepIsTheLimitOfManySmallOnes) {
    constexpr int kSteps = 20000;
    for (const double dt : {0.005, 0.025, 0.05, 0.2, 1.0, 20.0}) {
        const ImuSegment segment{dt, Eigen::Vector3d(0.6, -0.5, 0.65), random(10)};
        const InertialState start = random_state();
        InertialState once = start, often = start;
        integrate(once, segment, g_);
        for (int i = 0; i < kSteps; ++i)
            integrate(often, {dt / kSteps, segment.gyro, segment.accel}, g_);
        EXPECT_LT(boxminus(once, often).head<3>().norm(), 1e-9) << dt;
        const double bound = 1.2e-6 * segment.accel.norm();
        EXPECT_LT((once.p - often.p).norm(), bound * dt * dt) << dt;
        EXPECT_LT((once.v - often.v).norm(), bound * dt) << dt;
    }
}

TEST_F(Imu, PreintegrationPredictsAsStepwiseIntegrationDoes) {
    const auto segments = random_segments(40);
    const ImuBias bias{random(0.05), random(0.2)};
    const InertialState start = random_state();
    InertialState stepwise = start;
    for (const ImuSegment& s : segments)
        integrate(stepwise, {s.dt, s.gyro - bias.gyro, s.accel - bias.accel}, g_);
    const PreintegratedImu preintegrated(segments, bias, {});
    const InertialState predicted = preintegrated.predict(start, bias, g_);
    EXPECT_LT(boxminus(predicted, stepwise).norm(), 1e-12);
    EXPECT_LT(preintegrated.residual(start, predicted, bias, g_).norm(), 1e-12);
}

TEST_F(Imu, BiasCorrectionIsFirstOrder) {
    const auto segments = random_segments(20);
    const ImuBias bias{random(0.05), random(0.2)};
    const PreintegratedImu at_bias(segments, bias, {});
    const Eigen::Vector3d dg = random(1e-4), da = random(1e-3);
    const ImuBias moved{bias.gyro + dg, bias.accel + da};
    const PreintegratedImu exact(segments, moved, {});
    const InertialState start = random_state();
    EXPECT_LT(boxminus(at_bias.predict(start, moved, g_), exact.predict(start, moved, g_)).norm(),
              1e-7);
}

TEST_F(Imu, ResidualJacobiansMatchCentralDifferences) {
    const auto segments = random_segments(10);
    const ImuBias linearisation{random(0.05), random(0.2)};
    const PreintegratedImu preintegrated(segments, linearisation, {});
    const ImuBias bias{linearisation.gyro + random(0.01), linearisation.accel + random(0.1)};
    const InertialState i = random_state();
    const InertialState j = boxplus(preintegrated.predict(i, bias, g_), 0.3 * Vector9d::Ones());
    PreintegratedImu::Jacobian J;
    preintegrated.residual(i, j, bias, g_, &J);
    const auto residual = [&](const InertialState& a, const InertialState& b, const ImuBias& c,
                              const Eigen::Vector3d& g) {
        return preintegrated.residual(a, b, c, g);
    };
    const auto Ji = numeric_jacobian<9, 9>(
        [&](const Vector9d& d) { return residual(boxplus(i, d), j, bias, g_); });
    const auto Jj = numeric_jacobian<9, 9>(
        [&](const Vector9d& d) { return residual(i, boxplus(j, d), bias, g_); });
    const auto Jb = numeric_jacobian<9, 6>([&](const Vector6d& d) {
        return residual(i, j, {bias.gyro + d.head<3>(), bias.accel + d.tail<3>()}, g_);
    });
    const auto Jg = numeric_jacobian<9, 3>(
        [&](const Eigen::Vector3d& d) { return residual(i, j, bias, g_ + d); });
    EXPECT_LT((J.state_i - Ji).cwiseAbs().maxCoeff(), 1e-7);
    EXPECT_LT((J.state_j - Jj).cwiseAbs().maxCoeff(), 1e-7);
    EXPECT_LT((J.bias - Jb).cwiseAbs().maxCoeff(), 1e-7);
    EXPECT_LT((J.gravity - Jg).cwiseAbs().maxCoeff(), 1e-7);
}

// White noise as random steps in each of many parts of the segment.
TEST_F(Imu, OneSegmentsCovarianceIsThatOfManyParts) {
    const ImuNoise noise{2e-3, 3e-2, 0, 0, 0};
    const ImuSegment whole{0.1, random(0.3), random(3)};
    constexpr int kParts = 1000;
    const std::vector<ImuSegment> parts(kParts, {whole.dt / kParts, whole.gyro, whole.accel});
    const Matrix9d one = PreintegratedImu({whole}, {}, noise).covariance(),
                   many = PreintegratedImu(parts, {}, noise).covariance();
    const Vector9d sigma = many.diagonal().cwiseSqrt();
    const Matrix9d difference =
        sigma.cwiseInverse().asDiagonal() * (one - many) * sigma.cwiseInverse().asDiagonal();
    EXPECT_LT(difference.cwiseAbs().maxCoeff(), 0.02);
    const Matrix9d correlation =
        sigma.cwiseInverse().asDiagonal() * one * sigma.cwiseInverse().asDiagonal();
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Matrix9d>(correlation).eigenvalues()(0), 0.05);
}

TEST_F(Imu, SegmentsFillTheIntervalAndCutAtReadings) {
    ImuSequence imu;
    for (int k = 0; k < 5; ++k) imu.push_back({k * 10, Eigen::Vector3d::Constant(k), random(1)});
    const auto segments = imu.segments(5, 27);
    ASSERT_TRUE(segments);
    ASSERT_EQ(segments->size(), 3u);
    EXPECT_NEAR((*segments)[0].dt, 5e-9, 1e-15);
    EXPECT_NEAR((*segments)[0].gyro.x(), 0.75, 1e-12);
    EXPECT_NEAR((*segments)[1].gyro.x(), 1.5, 1e-12);
    EXPECT_NEAR((*segments)[2].gyro.x(), 2.35, 1e-12);
    EXPECT_FALSE(imu.segments(-1, 10));
    EXPECT_FALSE(imu.segments(0, 41));
    EXPECT_TRUE(imu.segments(40, 40)->empty());
}

}  // namespace
}  // namespace vio
