#include "libvio/batch/block_matrix.h"

#include <algorithm>
#include <numeric>
#include <stdexcept>

namespace vio::batch {

BlockMatrix::BlockMatrix(const std::vector<int>& dims, std::vector<std::pair<int, int>> pairs) {
    const int n = static_cast<int>(dims.size());
    offsets_.assign(n + 1, 0);
    std::partial_sum(dims.begin(), dims.end(), offsets_.begin() + 1);
    for (int i = 0; i < n; ++i) pairs.emplace_back(i, i);
    std::sort(pairs.begin(), pairs.end(), [](const auto& a, const auto& b) {
        return std::pair(a.second, a.first) < std::pair(b.second, b.first);
    });
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());

    rows_.resize(n);
    positions_.resize(n);
    diagonal_.reserve(offsets_.back());
    int total = 0;
    for (const auto& [row, col] : pairs) {
        rows_[col].push_back(row);
        positions_[col].push_back(total);
        if (row == col)
            for (int k = 0; k < dims[col]; ++k) diagonal_.push_back(total + k * dims[col] + k);
        total += dims[row] * dims[col];
    }
    values_.assign(total, 0.0);
}

int BlockMatrix::position(int row, int col) const {
    const auto& rows = rows_[col];
    const auto it = std::lower_bound(rows.begin(), rows.end(), row);
    if (it == rows.end() || *it != row) throw std::logic_error("no such block in the matrix");
    return positions_[col][it - rows.begin()];
}

}  // namespace vio::batch
