// The chi-square distribution.
#pragma once

namespace vio {

/// Value that a chi-square variable stays below with the given probability (Wilson and Hilferty
/// 1931; within 1 % for two and more degrees of freedom).
double chi_square_quantile(int degrees, double probability);

/// The same for the probability that a standard normal variable stays below `normal_quantile`.
double chi_square_value(int degrees, double normal_quantile);

}  // namespace vio
