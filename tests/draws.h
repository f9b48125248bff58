// Random vectors, the same whatever the compiler: in what order it evaluates the arguments of a
// constructor is its own choice.
#pragma once

#include <Eigen/Dense>
#include <random>

namespace vio::test {

/// Independent, of zero mean and unit variance; the last component is drawn first.
template <int N>
Eigen::Matrix<double, N, 1> normal_vector(std::normal_distribution<double>& normal,
                                          std::mt19937& random) {
    Eigen::Matrix<double, N, 1> v;
    for (int k = N - 1; k >= 0; --k) v(k) = normal(random);
    return v;
}

}  // namespace vio::test
