// Symmetric block-sparse matrix.
#pragma once

#include <Eigen/Dense>
#include <utility>
#include <vector>

namespace vio::batch {

/// Lower triangle of a symmetric matrix made of dense blocks, each column-major.
class BlockMatrix {
 public:
    using Block = Eigen::Map<Eigen::MatrixXd>;

    /// dims: size of each block row; pairs: (row, col) of the blocks below the diagonal that may be
    /// non-zero (row > col, any order, repetitions allowed). Diagonal blocks always exist.
    BlockMatrix(const std::vector<int>& dims, std::vector<std::pair<int, int>> pairs);

    int size() const { return offsets_.back(); }
    int blocks() const { return static_cast<int>(offsets_.size()) - 1; }
    int offset(int block) const { return offsets_[block]; }
    int dim(int block) const { return offsets_[block + 1] - offsets_[block]; }

    /// Index into values() of entry (0, 0) of a block; row >= col, and the block must exist.
    int position(int row, int col) const;
    Block block(int row, int col) {
        return {values_.data() + position(row, col), dim(row), dim(col)};
    }
    /// Blocks of a block column, in order of row, starting with the diagonal.
    const std::vector<int>& rows(int col) const { return rows_[col]; }

    void set_zero() { std::fill(values_.begin(), values_.end(), 0.0); }
    std::vector<double>& values() { return values_; }
    const std::vector<double>& values() const { return values_; }
    double& diagonal(int scalar_idx) { return values_[diagonal_[scalar_idx]]; }
    double diagonal(int scalar_idx) const { return values_[diagonal_[scalar_idx]]; }

 private:
    std::vector<int> offsets_;                 // first scalar index of each block, and the size
    std::vector<std::vector<int>> rows_;       // block rows of each block column
    std::vector<std::vector<int>> positions_;  // values index of each of them
    std::vector<int> diagonal_;                // values index of each diagonal entry
    std::vector<double> values_;
};

}  // namespace vio::batch
