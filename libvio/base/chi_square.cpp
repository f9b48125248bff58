#include "libvio/base/chi_square.h"

#include <cmath>

namespace vio {

double chi_square_value(int degrees, double normal_quantile) {
    const double spread = 2.0 / (9.0 * degrees);
    return degrees * std::pow(1 - spread + normal_quantile * std::sqrt(spread), 3);
}

double chi_square_quantile(int degrees, double probability) {
    // Normal quantile by bisection of its distribution function.
    double low = -10, high = 10;
    for (int i = 0; i < 60; ++i) {
        const double middle = (low + high) / 2;
        (0.5 * std::erfc(-middle / std::sqrt(2.0)) < probability ? low : high) = middle;
    }
    return chi_square_value(degrees, low);
}

}  // namespace vio
