// Cholesky factorisation of a symmetric block-sparse matrix from which products of low rank are
// subtracted (points eliminated from the normal equations), and entries of its inverse.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <vector>

#include "libvio/batch/block_matrix.h"
#include "libvio/batch/elimination.h"

namespace vio::batch {

using Matrix63d = Eigen::Matrix<double, 6, 3>;
// Parts of dense matrices that stand in larger ones.
using Strided = Eigen::Map<Eigen::MatrixXd, 0, Eigen::OuterStride<>>;
using ConstStrided = Eigen::Map<const Eigen::MatrixXd, 0, Eigen::OuterStride<>>;

/// The matrix S and right-hand side s that are factorised and solved:
///   S = A + diag(d) - sum_k W_k Q_k Q_k^T W_k^T,    s = a - sum_k W_k Q_k Q_k^T b_k.
/// W_k has six rows for each block of set k.
struct ReducedSystem {
    const BlockMatrix& A;
    const Eigen::VectorXd& d;
    const Eigen::VectorXd& a;
    const std::vector<Matrix63d>& W;        ///< of each member of each set, at BlockSets::terms
    const std::vector<Eigen::Matrix3d>& Q;  ///< of each set, upper triangular
    const std::vector<Eigen::Vector3d>& b;  ///< of each set
};

/// Multifrontal: each front gathers its part of A, of the sets and of its children, is partly
/// factorised as a dense matrix, and hands on what is left. Halves of the problem that do not touch
/// run on two threads; results do not depend on the number of threads. Nothing is allocated after
/// construction, except by sparse_inverse() and solve() with a matrix.
class BlockCholesky {
 public:
    BlockCholesky(const BlockMatrix& pattern, const BlockSets& sets, const std::vector<Part>& parts,
                  int threads);
    BlockCholesky(const BlockCholesky&) = delete;
    BlockCholesky& operator=(const BlockCholesky&) = delete;

    /// Factorises S and applies the factor to s. False if S is not positive definite.
    bool factorize(const ReducedSystem& system);

    /// S^-1 s; once after each factorize().
    void solve(Eigen::VectorXd& x);
    /// S^-1 B.
    Eigen::MatrixXd solve(const Eigen::MatrixXd& B) const;

    /// Ratio of smallest to largest diagonal entry of the factor, squared: a cheap estimate of the
    /// reciprocal condition number.
    double reciprocal_condition() const;

    const EliminationPlan& plan() const { return plan_; }

    /// Blocks of the inverse at the non-zero places of the factor (Takahashi's recursion).
    class SparseInverse {
     public:
        /// Throws std::logic_error for a block outside the factor's pattern.
        Eigen::MatrixXd block(int row, int col) const;
        /// Whether the block is in the factor's pattern.
        bool holds(int row, int col) const;

     private:
        friend class BlockCholesky;
        explicit SparseInverse(const EliminationPlan& plan) : plan_(plan) {}
        const EliminationPlan& plan_;
        std::vector<double> values_;  // as the factor's
    };
    SparseInverse sparse_inverse() const;

 private:
    // Where a block of A goes.
    struct Entry {
        int position, rows, cols;  // in A's values
        int row, col;              // in the front
        bool transposed;
    };
    // A member of a set: its terms, its row in the front, and the first member whose row does not
    // follow without a gap.
    struct Member {
        int term, row, run_end;
    };

    double* panel(const Front& front) { return values_.data() + front.panel; }
    const double* panel(const Front& front) const { return values_.data() + front.panel; }
    double* update(const Front& front) {
        return working_[std::min(static_cast<int>(front.part), 2)].data() + front.update;
    }
    template <typename Work>
    void over_fronts(bool upwards, Work work) const;
    void gather_matrix(int f, const ReducedSystem& system);
    void gather_sets(int f, const ReducedSystem& system);
    void gather_children(int f);
    bool factorize_front(int f);
    void index_matrix(const BlockMatrix& pattern);
    void index_sets(const BlockSets& sets);

    EliminationPlan plan_;
    int threads_;
    std::vector<std::vector<int>> children_;     // of each front
    std::vector<std::vector<Entry>> entries_;    // of each front
    std::vector<std::vector<int>> sets_;         // of each front: sets that enter there
    std::vector<Member> members_;                // of each set, in order of elimination
    std::vector<int> first_member_;              // of each set
    std::vector<double> values_;                 // the factor: a panel for each front
    std::vector<double> working_[3], terms_[3];  // of each part
    std::vector<double> forward_;                // right-hand side of each front
    std::vector<long> first_forward_;
};

}  // namespace vio::batch
