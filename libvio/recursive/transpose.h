// Transposition of large matrices by small squares: along whole columns of the one, every entry of
// the other would be in another cache line and page.
#pragma once

#include <Eigen/Dense>
#include <algorithm>

namespace vio {

/// target = source^T; they do not overlap.
template <typename Source, typename Target>
void transpose(const Source& source, Target&& target) {
    constexpr Eigen::Index kSide = 8;
    const Eigen::Index rows = source.rows(), columns = source.cols();
    for (Eigen::Index j = 0; j < columns; j += kSide) {
        const Eigen::Index width = std::min(kSide, columns - j);
        Eigen::Index i = 0;
        if (width == kSide)
            for (; i + kSide <= rows; i += kSide)
                target.template block<kSide, kSide>(j, i) =
                    source.template block<kSide, kSide>(i, j).transpose();
        target.block(j, i, width, rows - i) = source.block(i, j, rows - i, width).transpose();
    }
}

/// The upper triangle of a square from its lower one.
template <typename Square>
void mirror_lower(Square&& square) {
    constexpr Eigen::Index kSide = 32;
    const Eigen::Index n = square.rows();
    for (Eigen::Index j = 0; j < n; j += kSide) {
        const Eigen::Index width = std::min(kSide, n - j);
        transpose(square.block(j, 0, width, j), square.block(0, j, j, width));
        auto own = square.block(j, j, width, width);
        own.template triangularView<Eigen::StrictlyUpper>() = own.transpose();
    }
}

}  // namespace vio
