#include "libvio/batch/block_cholesky.h"

#include <algorithm>
#include <cmath>

#include "libvio/base/at_once.h"
#include "libvio/base/blas.h"
#include "libvio/base/types.h"
#include "libvio/batch/kernels.h"

namespace vio::batch {

BlockCholesky::BlockCholesky(const BlockMatrix& pattern, const BlockSets& sets,
                             const std::vector<Part>& parts, int threads)
    : threads_(threads) {
    std::vector<int> dims;
    std::vector<std::pair<int, int>> pairs;
    for (int col = 0; col < pattern.blocks(); ++col) {
        dims.push_back(pattern.dim(col));
        for (int row : pattern.rows(col))
            if (row != col) pairs.emplace_back(row, col);
    }
    plan_ = plan_elimination(dims, pairs, sets, parts);
    const int count = static_cast<int>(plan_.fronts.size());
    children_.resize(count);
    first_forward_.assign(count + 1, 0);
    for (int f = 0; f < count; ++f) {
        const Front& front = plan_.fronts[f];
        if (front.parent >= 0) children_[front.parent].push_back(f);
        first_forward_[f + 1] = first_forward_[f] + front.size;
    }
    index_matrix(pattern);
    index_sets(sets);
    values_.assign(plan_.values, 0.0);
    forward_.assign(first_forward_.back(), 0.0);
    int longest = 0;
    for (int k = 0; k < sets.count(); ++k)
        longest = std::max(longest, sets.first[k + 1] - sets.first[k]);
    for (int part = 0; part < 3; ++part) {
        working_[part].assign(plan_.working[part], 0.0);
        terms_[part].assign(18L * longest, 0.0);
    }
}

void BlockCholesky::index_matrix(const BlockMatrix& pattern) {
    entries_.resize(plan_.fronts.size());
    for (int col = 0; col < pattern.blocks(); ++col)
        for (int row : pattern.rows(col)) {
            const bool transposed = plan_.order[row] < plan_.order[col];
            const int f = plan_.front_of[transposed ? row : col];
            const int r = plan_.fronts[f].row_of(row, plan_.order),
                      c = plan_.fronts[f].row_of(col, plan_.order);
            entries_[f].push_back({pattern.position(row, col), pattern.dim(row), pattern.dim(col),
                                   transposed ? c : r, transposed ? r : c, transposed});
        }
}

void BlockCholesky::index_sets(const BlockSets& sets) {
    sets_.resize(plan_.fronts.size());
    for (int k = 0; k < sets.count(); ++k) {
        first_member_.push_back(static_cast<int>(members_.size()));
        const int begin = sets.first[k], end = sets.first[k + 1];
        if (begin == end) continue;
        std::vector<std::pair<int, int>> sequence;  // order, block
        for (int i = begin; i < end; ++i) sequence.emplace_back(plan_.order[sets.blocks[i]], i);
        std::sort(sequence.begin(), sequence.end());
        const int f = plan_.front_of[sets.blocks[sequence.front().second]];
        sets_[f].push_back(k);
        for (const auto& [order, i] : sequence)
            members_.push_back({sets.terms[k] + i - begin,
                                plan_.fronts[f].row_of(sets.blocks[i], plan_.order), 0});
        const int last = static_cast<int>(members_.size()) - 1;
        for (int m = last; m >= first_member_.back(); --m) {
            const bool joined = m < last && members_[m + 1].row == members_[m].row + 6 &&
                                members_[m + 1].row != plan_.fronts[f].pivots;
            members_[m].run_end = joined ? members_[m + 1].run_end : m + 1;
        }
    }
    first_member_.push_back(static_cast<int>(members_.size()));
}

// Children before parents (upwards) or parents before children; the halves on two threads.
template <typename Work>
void BlockCholesky::over_fronts(bool upwards, Work work) const {
    const int count = static_cast<int>(plan_.fronts.size());
    const auto begin_of = [&](int part) {
        return static_cast<int>(
            std::partition_point(plan_.fronts.begin(), plan_.fronts.end(),
                                 [&](const Front& f) { return static_cast<int>(f.part) < part; }) -
            plan_.fronts.begin());
    };
    const int begin[] = {0, begin_of(1), begin_of(2), count};
    const auto run = [&](int part) {
        for (int k = begin[part]; k < begin[part + 1]; ++k)
            work(upwards ? k : begin[part] + begin[part + 1] - 1 - k);
    };
    const auto halves = [&] {
        if (threads_ > 1 && begin[1] > 0 && begin[2] > begin[1]) {
            at_once(2, run);
        } else {
            run(0);
            run(1);
        }
    };
    if (upwards) halves();
    run(2);
    if (!upwards) halves();
}

void BlockCholesky::gather_matrix(int f, const ReducedSystem& system) {
    const Front& front = plan_.fronts[f];
    double* target = panel(front);
    std::fill(target, target + static_cast<long>(front.size) * front.pivots, 0.0);
    double* rest = update(front);
    for (int c = 0; c < front.rest(); ++c)
        std::fill(rest + static_cast<long>(c) * front.rest() + c,
                  rest + static_cast<long>(c + 1) * front.rest(), 0.0);
    double* rhs = forward_.data() + first_forward_[f];
    std::fill(rhs, rhs + front.size, 0.0);
    for (const Entry& e : entries_[f]) {
        const Eigen::Map<const Eigen::MatrixXd> from(system.A.values().data() + e.position, e.rows,
                                                     e.cols);
        double* place = target + static_cast<long>(e.col) * front.size + e.row;
        if (e.transposed)
            Strided(place, e.cols, e.rows, Eigen::OuterStride<>(front.size)) += from.transpose();
        else
            Strided(place, e.rows, e.cols, Eigen::OuterStride<>(front.size)) += from;
    }
    for (int k = 0; k < front.pivot_blocks; ++k) {
        const int row = front.starts[k], dim = front.starts[k + 1] - row;
        const int scalar = plan_.offsets[front.blocks[k]];
        for (int c = 0; c < dim; ++c) {
            target[static_cast<long>(row + c) * front.size + row + c] += system.d(scalar + c);
            rhs[row + c] = system.a(scalar + c);
        }
    }
}

void BlockCholesky::gather_sets(int f, const ReducedSystem& system) {
    const Front& front = plan_.fronts[f];
    double *target = panel(front), *rest = update(front);
    double* rhs = forward_.data() + first_forward_[f];
    double* T = terms_[std::min(static_cast<int>(front.part), 2)].data();
    for (int set : sets_[f]) {
        const Member* members = members_.data() + first_member_[set];
        const int begin = first_member_[set], count = first_member_[set + 1] - begin;
        const long stride = 6L * count;
        const Eigen::Matrix3d& Q = system.Q[set];
        const Eigen::Vector3d q = Q.transpose() * system.b[set];
        for (int m = 0; m < count; ++m)
            kernels::scale_term(system.W[members[m].term].data(), Q.data(), q.data(), T + 6 * m,
                                stride, rhs + members[m].row);
        for (int c = 0; c < count; ++c) {
            const int col = members[c].row;
            double* place;
            long ld;
            if (col < front.pivots) {
                place = target + static_cast<long>(col) * front.size;
                ld = front.size;
            } else {
                place = rest + static_cast<long>(col - front.pivots) * front.rest() - front.pivots;
                ld = front.rest();
            }
            for (int m = c; m < count;) {
                const int end = members[m].run_end - begin;
                kernels::subtract_product(place + members[m].row, ld, T + 6 * m, T + 6 * c, stride,
                                          6 * (end - m));
                m = end;
            }
        }
    }
}

void BlockCholesky::gather_children(int f) {
    const Front& front = plan_.fronts[f];
    double *target = panel(front), *rest = update(front);
    double* rhs = forward_.data() + first_forward_[f];
    for (int c : children_[f]) {
        const Front& child = plan_.fronts[c];
        const double* from = update(child);
        const double* child_rhs = forward_.data() + first_forward_[c] + child.pivots;
        const int n = child.rest();
        for (size_t k = 0; k < child.runs.size(); ++k) {
            const Front::Run& column = child.runs[k];
            kernels::add(rhs + column.to, child_rhs + column.from, column.length);
            for (int q = 0; q < column.length; ++q) {
                const double* source = from + static_cast<long>(column.from + q) * n;
                const int col = column.to + q;
                double* place = col < front.pivots
                                    ? target + static_cast<long>(col) * front.size
                                    : rest + static_cast<long>(col - front.pivots) * front.rest() -
                                          front.pivots;
                kernels::add(place + col, source + column.from + q, column.length - q);
                for (size_t r = k + 1; r < child.runs.size(); ++r)
                    kernels::add(place + child.runs[r].to, source + child.runs[r].from,
                                 child.runs[r].length);
            }
        }
    }
}

bool BlockCholesky::factorize_front(int f) {
    const Front& front = plan_.fronts[f];
    Eigen::Map<Eigen::MatrixXd> L(panel(front), front.size, front.pivots);
    if (!blas::factorize(L)) return false;
    Eigen::Map<Eigen::MatrixXd> rest(update(front), front.rest(), front.rest());
    blas::subtract_square(L.bottomRows(front.rest()), rest);
    Eigen::Map<Eigen::VectorXd> rhs(forward_.data() + first_forward_[f], front.size);
    auto top = rhs.head(front.pivots);
    L.topRows(front.pivots).triangularView<Eigen::Lower>().solveInPlace(top);
    rhs.tail(front.rest()).noalias() -= L.bottomRows(front.rest()) * top;
    return true;
}

bool BlockCholesky::factorize(const ReducedSystem& system) {
    const blas::Serial serial;
    bool failed[3] = {};  // of each part
    over_fronts(true, [&](int f) {
        const int part = std::min(static_cast<int>(plan_.fronts[f].part), 2);
        if (failed[part] || (part == 2 && (failed[0] || failed[1]))) return;
        gather_matrix(f, system);
        gather_sets(f, system);
        gather_children(f);
        failed[part] = !factorize_front(f);
    });
    return !failed[0] && !failed[1] && !failed[2];
}

void BlockCholesky::solve(Eigen::VectorXd& x) {
    x.resize(plan_.size());
    over_fronts(false, [&](int f) {
        const Front& front = plan_.fronts[f];
        const ConstStrided L(panel(front), front.size, front.pivots,
                             Eigen::OuterStride<>(front.size));
        // What the front's right-hand side had left has been handed on: room for x.
        Eigen::Map<Eigen::VectorXd> local(forward_.data() + first_forward_[f], front.size);
        for (size_t k = front.pivot_blocks; k < front.blocks.size(); ++k) {
            const int row = front.starts[k], dim = front.starts[k + 1] - row;
            local.segment(row, dim) = x.segment(plan_.offsets[front.blocks[k]], dim);
        }
        auto top = local.head(front.pivots);
        top.noalias() -= L.bottomRows(front.rest()).transpose() * local.tail(front.rest());
        L.topRows(front.pivots).triangularView<Eigen::Lower>().transpose().solveInPlace(top);
        for (int k = 0; k < front.pivot_blocks; ++k) {
            const int row = front.starts[k], dim = front.starts[k + 1] - row;
            x.segment(plan_.offsets[front.blocks[k]], dim) = top.segment(row, dim);
        }
    });
}

}  // namespace vio::batch
