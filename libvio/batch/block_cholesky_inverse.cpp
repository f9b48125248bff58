// What is read off a factor for covariances: solutions for many right-hand sides, entries of the
// inverse, an estimate of the condition.
#include <algorithm>
#include <limits>

#include "libvio/batch/block_cholesky.h"

namespace vio::batch {

Eigen::MatrixXd BlockCholesky::solve(const Eigen::MatrixXd& B) const {
    Eigen::MatrixXd X = B;
    const auto gathered = [&](const Front& front) {
        Eigen::MatrixXd local(front.size, X.cols());
        for (size_t k = 0; k < front.blocks.size(); ++k) {
            const int row = front.starts[k], dim = front.starts[k + 1] - row;
            local.middleRows(row, dim) = X.middleRows(plan_.offsets[front.blocks[k]], dim);
        }
        return local;
    };
    const auto scatter = [&](const Front& front, const Eigen::MatrixXd& local) {
        for (size_t k = 0; k < front.blocks.size(); ++k) {
            const int row = front.starts[k], dim = front.starts[k + 1] - row;
            X.middleRows(plan_.offsets[front.blocks[k]], dim) = local.middleRows(row, dim);
        }
    };
    const auto factor = [&](const Front& front) {
        return ConstStrided(panel(front), front.size, front.pivots,
                            Eigen::OuterStride<>(front.size));
    };
    for (const Front& front : plan_.fronts) {
        const auto L = factor(front);
        Eigen::MatrixXd local = gathered(front);
        auto top = local.topRows(front.pivots);
        L.topRows(front.pivots).triangularView<Eigen::Lower>().solveInPlace(top);
        local.bottomRows(front.rest()).noalias() -= L.bottomRows(front.rest()) * top;
        scatter(front, local);
    }
    for (auto front = plan_.fronts.rbegin(); front != plan_.fronts.rend(); ++front) {
        const auto L = factor(*front);
        Eigen::MatrixXd local = gathered(*front);
        auto top = local.topRows(front->pivots);
        top.noalias() -= L.bottomRows(front->rest()).transpose() * local.bottomRows(front->rest());
        L.topRows(front->pivots).triangularView<Eigen::Lower>().transpose().solveInPlace(top);
        scatter(*front, local);
    }
    return X;
}

double BlockCholesky::reciprocal_condition() const {
    double smallest = std::numeric_limits<double>::infinity(), largest = 0;
    for (const Front& front : plan_.fronts)
        for (int k = 0; k < front.pivots; ++k) {
            const double entry = panel(front)[static_cast<long>(k) * front.size + k];
            smallest = std::min(smallest, entry);
            largest = std::max(largest, entry);
        }
    return largest > 0 ? (smallest / largest) * (smallest / largest) : 0;
}

BlockCholesky::SparseInverse BlockCholesky::sparse_inverse() const {
    // With a front's pivots C and other rows R, G = L_RC L_CC^-1:
    //   Z_RC = -Z_RR G,   Z_CC = (L_CC L_CC^T)^-1 + G^T Z_RR G;   Z_RR stands in its parent.
    SparseInverse inverse(plan_);
    inverse.values_.assign(values_.size(), 0.0);
    std::vector<Eigen::MatrixXd> known(plan_.fronts.size());  // Z_RR of fronts to come, lower
    for (int f = static_cast<int>(plan_.fronts.size()) - 1; f >= 0; --f) {
        const Front& front = plan_.fronts[f];
        const int p = front.pivots, r = front.rest();
        const ConstStrided L(panel(front), front.size, p, Eigen::OuterStride<>(front.size));
        Eigen::MatrixXd inverse_L = Eigen::MatrixXd::Identity(p, p);
        L.topRows(p).triangularView<Eigen::Lower>().solveInPlace(inverse_L);
        Eigen::MatrixXd Z(front.size, front.size);
        const Eigen::MatrixXd G = L.bottomRows(r) * inverse_L;
        Z.bottomRightCorner(r, r) = known[f].selfadjointView<Eigen::Lower>();
        known[f].resize(0, 0);
        Z.bottomLeftCorner(r, p).noalias() = -Z.bottomRightCorner(r, r) * G;
        Z.topLeftCorner(p, p).noalias() = inverse_L.transpose() * inverse_L;
        Z.topLeftCorner(p, p).noalias() -= G.transpose() * Z.bottomLeftCorner(r, p);
        Strided(inverse.values_.data() + front.panel, front.size, p,
                Eigen::OuterStride<>(front.size)) = Z.leftCols(p);
        for (int c : children_[f]) {
            const Front& child = plan_.fronts[c];
            known[c].resize(child.rest(), child.rest());
            for (size_t a = 0; a < child.runs.size(); ++a)
                for (size_t b = a; b < child.runs.size(); ++b) {
                    const Front::Run &col = child.runs[a], &row = child.runs[b];
                    known[c].block(row.from, col.from, row.length, col.length) =
                        Z.block(row.to, col.to, row.length, col.length);
                }
        }
    }
    return inverse;
}

Eigen::MatrixXd BlockCholesky::SparseInverse::block(int row, int col) const {
    const bool transposed = plan_.order[row] < plan_.order[col];
    const int first = transposed ? row : col, second = transposed ? col : row;
    const Front& front = plan_.fronts[plan_.front_of[first]];
    const auto dim = [&](int block) { return plan_.offsets[block + 1] - plan_.offsets[block]; };
    const ConstStrided Z(values_.data() + front.panel, front.size, front.pivots,
                         Eigen::OuterStride<>(front.size));
    Eigen::MatrixXd result = Z.block(front.row_of(second, plan_.order),
                                     front.row_of(first, plan_.order), dim(second), dim(first));
    if (row == col) result = result.selfadjointView<Eigen::Lower>();
    if (transposed) result.transposeInPlace();
    return result;
}

bool BlockCholesky::SparseInverse::holds(int row, int col) const {
    const bool transposed = plan_.order[row] < plan_.order[col];
    const int first = transposed ? row : col, second = transposed ? col : row;
    const std::vector<int>& blocks = plan_.fronts[plan_.front_of[first]].blocks;
    return std::binary_search(blocks.begin(), blocks.end(), second,
                              [&](int a, int b) { return plan_.order[a] < plan_.order[b]; });
}

}  // namespace vio::batch
