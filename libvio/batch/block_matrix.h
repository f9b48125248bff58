// Symmetric block-sparse matrix, its Cholesky factorisation by CHOLMOD, and entries of its inverse.
#pragma once

#include <Eigen/Dense>
#include <memory>
#include <utility>
#include <vector>

namespace vio::batch {

/// Lower triangle of a symmetric matrix made of dense blocks, stored as the compressed columns that
/// CHOLMOD reads: all scalar columns of a block column share one pattern, so a block is a strided
/// dense matrix and can be added to in place.
class BlockMatrix {
 public:
    using Block = Eigen::Map<Eigen::MatrixXd, 0, Eigen::OuterStride<>>;

    /// dims: size of each block row; pairs: (row, col) of the blocks below the diagonal that may be
    /// non-zero (row > col, any order, repetitions allowed). Diagonal blocks always exist.
    BlockMatrix(const std::vector<int>& dims, std::vector<std::pair<int, int>> pairs);

    int size() const { return offsets_.back(); }
    int offset(int block) const { return offsets_[block]; }
    int dim(int block) const { return offsets_[block + 1] - offsets_[block]; }

    /// Index into values() of entry (0, 0) of a block; row >= col, and the block must exist.
    int position(int row, int col) const;
    int stride(int col) const { return strides_[col]; }
    Block block(int row, int col) {
        return {values_.data() + position(row, col), dim(row), dim(col),
                Eigen::OuterStride<>(stride(col))};
    }
    /// Blocks of a block column, in order of row, starting with the diagonal.
    const std::vector<int>& rows(int col) const { return rows_[col]; }

    void set_zero() { std::fill(values_.begin(), values_.end(), 0.0); }
    std::vector<double>& values() { return values_; }
    const std::vector<double>& values() const { return values_; }
    double& diagonal(int scalar_idx) { return values_[diagonal_[scalar_idx]]; }

 private:
    friend class BlockCholesky;
    std::vector<int> offsets_;              // first scalar index of each block, and the size
    std::vector<std::vector<int>> rows_;    // block rows of each block column
    std::vector<std::vector<int>> starts_;  // scalar row offset of each of them in the column
    std::vector<int> strides_;              // scalar entries of each column
    std::vector<int> first_;                // values index of each block column
    std::vector<int> diagonal_;             // values index of each diagonal entry
    std::vector<double> values_;
};

/// Cholesky factorisation of a BlockMatrix. The fill-reducing order is chosen once, as the cheaper
/// of the given order (time, then border) and approximate minimum degree.
class BlockCholesky {
 public:
    explicit BlockCholesky(const BlockMatrix& pattern);
    ~BlockCholesky();
    BlockCholesky(const BlockCholesky&) = delete;
    BlockCholesky& operator=(const BlockCholesky&) = delete;

    /// False if the matrix is not positive definite.
    bool factorize(const BlockMatrix& matrix);

    /// A^-1 b for one or several right-hand sides.
    Eigen::MatrixXd solve(const Eigen::MatrixXd& b) const;

    /// Ratio of smallest to largest diagonal entry of the factor, squared: a cheap estimate of the
    /// reciprocal condition number.
    double reciprocal_condition() const;

    /// Entries of the inverse at the non-zero places of the factor (Takahashi's recursion).
    class SparseInverse {
     public:
        /// Block of the inverse; entries outside the factor's pattern are not available (throws
        /// std::logic_error).
        Eigen::MatrixXd block(int row_begin, int rows, int col_begin, int cols) const;

     private:
        friend class BlockCholesky;
        double entry(int row, int col) const;
        std::vector<int> inverse_permutation_, starts_, rows_;
        std::vector<double> values_;
    };
    SparseInverse sparse_inverse() const;

 private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace vio::batch
