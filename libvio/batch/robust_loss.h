// Robust losses of the image terms, and what they leave of the images' information.
//
// A loss that bends below the square treats images as less certain than they are. In regression
// that costs efficiency alone. But scale is a regression with errors in both variables: what
// readings and images disagree by is shared between them by their variances, and where images are
// believed too little, some of the readings' noise passes for motion, which then comes out too
// large (by 4 % in the start of the crane). So a loss is multiplied by E[psi'] /
// E[psi^2], with psi its derivative and the expectation over normal noise: as of a likelihood, the
// variance of its gradient is then its mean curvature (Bartlett's identity), and the bias is gone
// to first order.
//
// The curvature, E[psi']^2 / E[psi^2] of the square's, is the images' information, too. The weights
// of iteratively reweighted least squares, psi(r) / r, are larger: for covariances they are
// multiplied by information(), which makes them that on average.
#pragma once

#include <string>

namespace vio::batch {

/// Of the squared norms of whitened residuals of two components.
class RobustLoss {
 public:
    /// name: none, huber or cauchy; width: in standard deviations.
    RobustLoss(const std::string& name, double width);

    /// In place of the squared norm.
    double cost(double distance2) const { return scale_ * bent(distance2); }
    /// Of iteratively reweighted least squares.
    double weight(double distance2) const { return scale_ * bent_weight(distance2); }
    /// What weights are multiplied by to give, on average over normal noise, the information.
    double information() const { return information_; }
    /// Mean cost of normal noise.
    double noise_cost() const { return noise_cost_; }

 private:
    enum class Kind { kNone, kHuber, kCauchy };

    double bent(double distance2) const;
    double bent_weight(double distance2) const;
    double curvature(double distance2) const;

    Kind kind_;
    double width_, width2_, scale_ = 1, information_ = 1, noise_cost_ = 2;
};

}  // namespace vio::batch
