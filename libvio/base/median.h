// The middle of some values.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace vio {

/// The value with as many below as above it, the upper of the two for an even number; zero if there
/// are none.
template <typename T>
T median(std::vector<T> values) {
    if (values.empty()) return T{};
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

}  // namespace vio
