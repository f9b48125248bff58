#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "libvio/geometry/pose.h"
#include "libvio/geometry/triangulation.h"
#include "tests/draws.h"
#include "tests/unit/numeric_jacobian.h"

namespace vio {
namespace {

using test::numeric_jacobian;

TEST(So3, LogInvertsExpFromZeroToPi) {
    std::mt19937 engine(1);
    std::normal_distribution<double> normal;
    for (double angle : {0.0, 1e-9, 1e-5, 1e-4, 1e-2, 1.0, 3.0, M_PI - 1e-5, M_PI - 1e-9}) {
        for (int i = 0; i < 100; ++i) {
            const Eigen::Vector3d axis = test::normal_vector<3>(normal, engine).normalized();
            const Eigen::Matrix3d R = so3::exp(angle * axis);
            EXPECT_LT((R * R.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-14);
            EXPECT_LT((so3::log(R) - angle * axis).norm(), 1e-12) << angle;
        }
    }
}

TEST(So3, RightJacobianMatchesCentralDifferences) {
    for (double angle : {1e-7, 1e-3, 0.09, 0.11, 1.5, 3.0}) {
        const Eigen::Vector3d theta = angle * Eigen::Vector3d(0.6, -0.48, 0.64);
        const Eigen::Matrix3d R = so3::exp(theta);
        const auto J = numeric_jacobian<3, 3>([&](const Eigen::Vector3d& d) {
            return so3::log(R.transpose() * so3::exp(theta + d));
        });
        EXPECT_LT((so3::right_jacobian(theta) - J).cwiseAbs().maxCoeff(), 1e-9) << angle;
        EXPECT_LT((so3::right_jacobian(theta) * so3::right_jacobian_inverse(theta) -
                   Eigen::Matrix3d::Identity())
                      .norm(),
                  1e-12)
            << angle;
    }
}

TEST(Pose, RightComposeJacobianMatchesCentralDifferences) {
    const Pose a{so3::exp({0.3, -0.2, 0.9}), {1, 2, 3}}, b{so3::exp({-1, 0.4, 0.1}), {0.5, -1, 2}};
    const auto J = numeric_jacobian<6, 6>(
        [&](const Vector6d& d) { return (a.boxplus(d) * b).boxminus(a * b); });
    EXPECT_LT((right_compose_jacobian(a, b) - J).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(Triangulation, CovarianceIsThatOfTheNoise) {
    const Eigen::Vector3d point(0.5, -0.3, 6);
    const double sigma = 1e-3;
    std::mt19937 engine(3);
    std::normal_distribution<double> normal;
    double mean_nees = 0;
    constexpr int kRuns = 500;
    for (int run = 0; run < kRuns; ++run) {
        std::vector<SightLine> lines;
        for (int i = 0; i < 8; ++i) {
            const Eigen::Vector3d origin(0.2 * i, 0.05 * i * i, 0);
            const Eigen::Vector3d d = (point - origin).normalized();
            // Small rotation about a random axis across the line of sight.
            const Eigen::Vector3d noise = sigma * test::normal_vector<3>(normal, engine);
            lines.push_back({origin, (d + noise - d * d.dot(noise)).normalized()});
        }
        const auto result = triangulate(lines, sigma);
        ASSERT_TRUE(result);
        const Eigen::Vector3d e = result->point - point;
        mean_nees += e.dot(result->covariance.inverse() * e) / kRuns;
    }
    // Mean of chi-square(3) over 500 runs: 3 +- 3.3 standard deviations of sqrt(6/500).
    EXPECT_NEAR(mean_nees, 3, 3.3 * std::sqrt(6.0 / kRuns));
}

TEST(Triangulation, RefusesParallelLinesAndPointsBehind) {
    const SightLine a{{0, 0, 0}, {0, 0, 1}}, b{{1, 0, 0}, {0, 0, 1}};
    EXPECT_FALSE(triangulate({a, b}, 1e-3));
    const SightLine c{{1, 0, 0}, Eigen::Vector3d(1, 0, 1).normalized()};
    EXPECT_FALSE(triangulate({a, c}, 1e-3));
    EXPECT_FALSE(triangulate({a}, 1e-3));
}

}  // namespace
}  // namespace vio
