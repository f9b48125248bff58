#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "libvio/batch/robust_loss.h"

namespace vio::batch {
namespace {

// Over residuals of normal noise, by sums over a grid: variance of the loss's gradient (half of the
// cost's), its mean curvature, and the mean weight.
struct OverNoise {
    double variance = 0, curvature = 0, weight = 0, cost = 0;

    explicit OverNoise(const RobustLoss& loss) {
        constexpr double kStep = 0.02, kLast = 8, kSmall = 1e-4;
        const auto half = [&](double x, double y) { return 0.5 * loss.cost(x * x + y * y); };
        for (double x = -kLast; x < kLast; x += kStep)
            for (double y = -kLast; y < kLast; y += kStep) {
                const double p = kStep * kStep * std::exp(-(x * x + y * y) / 2) / (2 * M_PI);
                const double ahead = half(x + kSmall, y), behind = half(x - kSmall, y);
                const double slope = (ahead - behind) / (2 * kSmall);
                variance += p * slope * slope;
                curvature += p * (ahead - 2 * half(x, y) + behind) / (kSmall * kSmall);
                weight += p * loss.weight(x * x + y * y);
                cost += p * loss.cost(x * x + y * y);
            }
    }
};

TEST(RobustLoss, GradientVariesAsItCurves) {
    for (const std::string name : {"huber", "cauchy"})
        for (const double width : {0.7, 2.0, 5.0}) {
            const RobustLoss loss(name, width);
            const OverNoise found(loss);
            EXPECT_NEAR(found.variance, found.curvature, 0.01 * found.curvature) << name << width;
            EXPECT_NEAR(loss.information() * found.weight, found.curvature, 0.01 * found.curvature)
                << name << width;
            EXPECT_NEAR(loss.noise_cost(), found.cost, 0.01 * found.cost) << name << width;
            EXPECT_LT(found.curvature, 1) << name << width;  // a robust loss costs information
        }
}

// By the exponential integral: E[psi'] = q (1 - q A), E[psi^2] = q^2 (A (1 + q) - 1) with q half
// the width squared and A = exp(q) E1(q).
TEST(RobustLoss, CauchysIsKnown) {
    const double q = 2, A = std::exp(q) * -std::expint(-q), slope = q * (1 - q * A);
    const RobustLoss loss("cauchy", 2);
    EXPECT_NEAR(loss.weight(0), slope / (q * q * (A * (1 + q) - 1)), 1e-6);
    EXPECT_NEAR(loss.information(), slope / (q * A), 1e-6);
    EXPECT_NEAR(loss.cost(4), loss.weight(0) * 4 * std::log(2), 1e-9);
}

TEST(RobustLoss, OfGreatWidthIsTheSquare) {
    for (const std::string name : {"none", "huber", "cauchy"}) {
        const RobustLoss loss(name, 100);
        EXPECT_NEAR(loss.cost(9), 9, 0.01) << name;
        EXPECT_NEAR(loss.weight(9), 1, 2e-3) << name;
        EXPECT_NEAR(loss.information(), 1, 1e-3) << name;
    }
}

}  // namespace
}  // namespace vio::batch
