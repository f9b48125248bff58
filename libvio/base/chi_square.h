// The chi-square distribution.
#pragma once

namespace vio {

/// Value that a chi-square variable stays below with the given probability (Wilson and Hilferty
/// 1931; within 1 % for two and more degrees of freedom).
double chi_square_quantile(int degrees, double probability);

}  // namespace vio
