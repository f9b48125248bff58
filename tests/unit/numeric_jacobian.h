// Central differences, to check analytic Jacobians against.
#pragma once

#include <Eigen/Dense>

namespace vio::test {

/// d f / d x at x = 0 of f: R^n -> R^m, by central differences.
template <int M, int N, typename F>
Eigen::Matrix<double, M, N> numeric_jacobian(F&& f, double step = 1e-6) {
    Eigen::Matrix<double, M, N> J;
    for (int i = 0; i < N; ++i) {
        Eigen::Matrix<double, N, 1> d = Eigen::Matrix<double, N, 1>::Zero();
        d(i) = step;
        const Eigen::Matrix<double, M, 1> plus = f(d);
        d(i) = -step;
        const Eigen::Matrix<double, M, 1> minus = f(d);
        J.col(i) = (plus - minus) / (2 * step);
    }
    return J;
}

}  // namespace vio::test
