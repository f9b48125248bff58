// Quintic B-spline curve with continuous fourth derivative.
#pragma once

#include <Eigen/Dense>
#include <array>
#include <vector>

namespace vio {

/// How a curve behaves at its two ends.
enum class CurveEnds {
    kAtRest,  ///< first and second derivative are zero
    kFree     ///< third and fourth derivative are zero
};

/// Curve in R^d over [begin, end]; outside it the end values are held (derivatives are zero there).
/// Source: Piegl and Tiller, The NURBS Book (1997), algorithms A2.1, A2.2 and Eq. (3.3).
class BSpline {
 public:
    static constexpr int kDegree = 5;
    static constexpr int kDerivatives = 2;  ///< derivatives that evaluate() offers

    /// Passes through values.row(i) at times[i] (strictly increasing, at least two); its pieces
    /// join at these times. Throws InputError otherwise.
    static BSpline interpolating(const std::vector<double>& times, const Eigen::MatrixXd& values,
                                 CurveEnds ends);

    /// Least-squares fit with pieces of about `piece` (in the unit of times); a vanishing penalty
    /// on the third derivative fills pieces that hold too few values.
    static BSpline fitted(const std::vector<double>& times, const Eigen::MatrixXd& values,
                          double piece);

    /// Derivative of order 0..kDerivatives at t.
    Eigen::VectorXd evaluate(double t, int derivative) const;

    double begin() const { return begin_; }
    double end() const { return end_; }

 private:
    BSpline(const std::vector<double>& breaks, const Eigen::MatrixXd& coefficients);

    double begin_, end_;
    /// Knots and coefficients (one row each) of the curve and of its derivatives.
    std::array<std::vector<double>, kDerivatives + 1> knots_;
    std::array<Eigen::MatrixXd, kDerivatives + 1> coefficients_;
};

}  // namespace vio
