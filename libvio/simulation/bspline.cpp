#include "libvio/simulation/bspline.h"

#include <Eigen/Sparse>
#include <algorithm>
#include <cmath>

#include "libvio/base/errors.h"

namespace vio {
namespace {

constexpr int kDegree = BSpline::kDegree;
using Knots = std::vector<double>;
using Sparse = Eigen::SparseMatrix<double>;
using Triplets = std::vector<Eigen::Triplet<double>>;

Knots clamped_knots(const std::vector<double>& breaks) {
    Knots knots(kDegree, breaks.front());
    knots.insert(knots.end(), breaks.begin(), breaks.end());
    knots.insert(knots.end(), kDegree, breaks.back());
    return knots;
}

int coefficient_count(const Knots& knots, int degree) {
    return static_cast<int>(knots.size()) - degree - 1;
}

// Index of the knot interval that holds t (A2.1).
int span(const Knots& knots, int degree, double t) {
    const int n = coefficient_count(knots, degree);
    const auto first = knots.begin() + degree, last = knots.begin() + n;
    return static_cast<int>(std::upper_bound(first, last, t) - knots.begin()) - 1;
}

// The degree + 1 basis functions that do not vanish on interval s, at t (A2.2).
std::array<double, kDegree + 1> basis(const Knots& knots, int degree, int s, double t) {
    std::array<double, kDegree + 1> N{1};
    for (int j = 1; j <= degree; ++j) {
        double carried = 0;
        for (int r = 0; r < j; ++r) {
            const double right = knots[s + r + 1], left = knots[s + 1 - j + r];
            const double share = N[r] / (right - left);
            N[r] = carried + (right - t) * share;
            carried = (t - left) * share;
        }
        N[j] = carried;
    }
    return N;
}

// Maps the coefficients of a curve to those of its derivative (Eq. 3.3).
Sparse derivative_matrix(const Knots& knots, int degree) {
    const int n = coefficient_count(knots, degree);
    Triplets entries;
    for (int i = 0; i + 1 < n; ++i) {
        const double rate = degree / (knots[i + degree + 1] - knots[i + 1]);
        entries.emplace_back(i, i, -rate);
        entries.emplace_back(i, i + 1, rate);
    }
    Sparse D(n - 1, n);
    D.setFromTriplets(entries.begin(), entries.end());
    return D;
}

Knots derivative_knots(const Knots& knots) {
    return {knots.begin() + 1, knots.end() - 1};
}

// Row i maps the coefficients to the derivative of the given order at times[i].
Sparse evaluation_matrix(const std::vector<double>& times, Knots knots, int derivative) {
    const int n = coefficient_count(knots, kDegree);
    Sparse D(n, n);
    D.setIdentity();
    for (int k = 0; k < derivative; ++k) {
        D = (derivative_matrix(knots, kDegree - k) * D).eval();
        knots = derivative_knots(knots);
    }
    const int degree = kDegree - derivative;
    Triplets entries;
    for (int i = 0; i < static_cast<int>(times.size()); ++i) {
        const int s = span(knots, degree, times[i]);
        const auto N = basis(knots, degree, s, times[i]);
        for (int j = 0; j <= degree; ++j) entries.emplace_back(i, s - degree + j, N[j]);
    }
    Sparse B(static_cast<int>(times.size()), coefficient_count(knots, degree));
    B.setFromTriplets(entries.begin(), entries.end());
    return B * D;
}

Triplets shifted(const Sparse& rows, int first_row) {
    Triplets entries;
    for (int c = 0; c < rows.outerSize(); ++c)
        for (Sparse::InnerIterator it(rows, c); it; ++it)
            entries.emplace_back(first_row + static_cast<int>(it.row()), c, it.value());
    return entries;
}

void check_times(const std::vector<double>& times, Eigen::Index rows) {
    if (times.size() < 2 || static_cast<Eigen::Index>(times.size()) != rows)
        throw InputError("trajectory: fewer than two poses; give at least two");
    for (size_t i = 1; i < times.size(); ++i)
        if (!(times[i] > times[i - 1]))
            throw InputError("trajectory (t = " + std::to_string(times[i]) +
                             " s): time does not increase; sort the poses, drop duplicates");
}

}  // namespace

BSpline::BSpline(const std::vector<double>& breaks, const Eigen::MatrixXd& coefficients)
    : begin_(breaks.front()), end_(breaks.back()) {
    knots_[0] = clamped_knots(breaks);
    coefficients_[0] = coefficients;
    for (int k = 1; k <= kDerivatives; ++k) {
        coefficients_[k] = derivative_matrix(knots_[k - 1], kDegree - k + 1) * coefficients_[k - 1];
        knots_[k] = derivative_knots(knots_[k - 1]);
    }
}

BSpline BSpline::interpolating(const std::vector<double>& times, const Eigen::MatrixXd& values,
                               CurveEnds ends) {
    check_times(times, values.rows());
    const Knots knots = clamped_knots(times);
    const int n = coefficient_count(knots, kDegree), m = static_cast<int>(times.size());
    // Derivatives at the ends are scaled by the interval so that the rows are of like size.
    const double interval = (times.back() - times.front()) / (m - 1);
    const int first_derivative = ends == CurveEnds::kAtRest ? 1 : 3;
    Triplets entries = shifted(evaluation_matrix(times, knots, 0), 0);
    for (int k = 0; k < 2; ++k) {
        const int order = first_derivative + k;
        const Sparse rows = evaluation_matrix({times.front(), times.back()}, knots, order) *
                            std::pow(interval, order);
        const Triplets more = shifted(rows, m + 2 * k);
        entries.insert(entries.end(), more.begin(), more.end());
    }
    Sparse A(n, n);
    A.setFromTriplets(entries.begin(), entries.end());
    Eigen::MatrixXd right = Eigen::MatrixXd::Zero(n, values.cols());
    right.topRows(m) = values;
    const Eigen::SparseLU<Sparse> lu(A);
    return BSpline(times, lu.solve(right));
}

BSpline BSpline::fitted(const std::vector<double>& times, const Eigen::MatrixXd& values,
                        double piece) {
    check_times(times, values.rows());
    const double length = times.back() - times.front();
    const int pieces = std::max(1, static_cast<int>(std::lround(length / piece)));
    std::vector<double> breaks, middles;
    for (int i = 0; i <= pieces; ++i) breaks.push_back(times.front() + length * i / pieces);
    breaks.back() = times.back();
    for (int i = 0; i < pieces; ++i) middles.push_back((breaks[i] + breaks[i + 1]) / 2);
    const Knots knots = clamped_knots(breaks);
    const Sparse B = evaluation_matrix(times, knots, 0);
    const Sparse J = evaluation_matrix(middles, knots, 3) * std::pow(length / pieces, 3);
    constexpr double kPenalty = 1e-6;
    const Sparse A = Sparse(B.transpose() * B) + kPenalty * Sparse(J.transpose() * J);
    const Eigen::SimplicialLDLT<Sparse> ldlt(A);
    return BSpline(breaks, ldlt.solve(B.transpose() * values));
}

Eigen::VectorXd BSpline::evaluate(double t, int derivative) const {
    const auto& coefficients = coefficients_[derivative];
    if (derivative > 0 && (t < begin_ || t > end_))
        return Eigen::VectorXd::Zero(coefficients.cols());
    t = std::clamp(t, begin_, end_);
    const int degree = kDegree - derivative;
    const int s = span(knots_[derivative], degree, t);
    const auto N = basis(knots_[derivative], degree, s, t);
    Eigen::VectorXd value = Eigen::VectorXd::Zero(coefficients.cols());
    for (int j = 0; j <= degree; ++j) value += N[j] * coefficients.row(s - degree + j).transpose();
    return value;
}

}  // namespace vio
