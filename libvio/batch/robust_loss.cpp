#include "libvio/batch/robust_loss.h"

#include <cmath>

namespace vio::batch {

RobustLoss::RobustLoss(const std::string& name, double width)
    : kind_(name == "huber"    ? Kind::kHuber
            : name == "cauchy" ? Kind::kCauchy
                               : Kind::kNone),
      width_(width),
      width2_(width * width) {
    if (kind_ == Kind::kNone) return;
    // Over squared norms s of normal noise, of density exp(-s / 2) / 2, in steps of log s.
    constexpr double kFirst = -25, kLast = 5, kStep = 0.01;
    double weight = 0, square = 0, slope = 0, cost = 0;
    for (double log_s = kFirst; log_s < kLast; log_s += kStep) {
        const double s = std::exp(log_s), probability = kStep * s * std::exp(-s / 2) / 2;
        const double w = bent_weight(s);
        weight += probability * w;
        square += probability * w * w * s / 2;
        slope += probability * curvature(s);
        cost += probability * bent(s);
    }
    scale_ = slope / square;
    information_ = slope / weight;
    noise_cost_ = scale_ * cost;
}

double RobustLoss::bent(double distance2) const {
    if (kind_ == Kind::kCauchy) return width2_ * std::log1p(distance2 / width2_);
    if (kind_ == Kind::kHuber && distance2 > width2_)
        return 2 * width_ * std::sqrt(distance2) - width2_;
    return distance2;
}

double RobustLoss::bent_weight(double distance2) const {
    if (kind_ == Kind::kCauchy) return 1 / (1 + distance2 / width2_);
    if (kind_ == Kind::kHuber && distance2 > width2_) return width_ / std::sqrt(distance2);
    return 1;
}

// Mean of the two diagonal entries of d psi / d r: w + s dw / ds.
double RobustLoss::curvature(double distance2) const {
    const double w = bent_weight(distance2);
    if (kind_ == Kind::kCauchy) return w * w;
    return distance2 > width2_ ? w / 2 : w;
}

}  // namespace vio::batch
