#pragma once

namespace vio {

inline double squared(double x) {
    return x * x;
}

}  // namespace vio
