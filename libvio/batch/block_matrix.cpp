#include "libvio/batch/block_matrix.h"

#include <cholmod.h>
#include <omp.h>

#include <algorithm>
#include <cstring>
#include <numeric>
#include <stdexcept>

namespace vio::batch {

// Of OpenBLAS, where it is the BLAS that CHOLMOD runs on; null otherwise.
extern "C" {
[[gnu::weak]] void openblas_set_num_threads(int threads);
[[gnu::weak]] int openblas_get_num_threads();
}

namespace {

// CHOLMOD runs several OpenMP loops, and BLAS its threads, for each supernode. Ours are small, and
// waking or awaiting threads for them costs more than half of the time on an idle machine and ten
// times the work on a busy one. Inside this scope all run on the calling thread (the settings are
// the process's: not for several threads at once).
class SerialKernels {
 public:
    SerialKernels() {
        omp_set_max_active_levels(0);
        if (openblas_set_num_threads) openblas_set_num_threads(1);
    }
    ~SerialKernels() {
        omp_set_max_active_levels(levels_);
        if (openblas_set_num_threads) openblas_set_num_threads(blas_threads_);
    }
    SerialKernels(const SerialKernels&) = delete;
    SerialKernels& operator=(const SerialKernels&) = delete;

 private:
    int levels_ = omp_get_max_active_levels();
    int blas_threads_ = openblas_get_num_threads ? openblas_get_num_threads() : 1;
};

}  // namespace

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
    starts_.resize(n);
    strides_.assign(n, 0);
    first_.assign(n, 0);
    for (const auto& [row, col] : pairs) {
        rows_[col].push_back(row);
        starts_[col].push_back(strides_[col]);
        strides_[col] += dims[row];
    }
    diagonal_.reserve(offsets_.back());
    int total = 0;
    for (int col = 0; col < n; ++col) {
        first_[col] = total;
        for (int c = 0; c < dims[col]; ++c) diagonal_.push_back(total + c * strides_[col] + c);
        total += strides_[col] * dims[col];
    }
    values_.assign(total, 0.0);
}

int BlockMatrix::position(int row, int col) const {
    const auto& rows = rows_[col];
    const auto it = std::lower_bound(rows.begin(), rows.end(), row);
    if (it == rows.end() || *it != row) throw std::logic_error("no such block in the matrix");
    return first_[col] + starts_[col][it - rows.begin()];
}

struct BlockCholesky::Impl {
    mutable cholmod_common common;
    cholmod_sparse* matrix = nullptr;
    cholmod_factor* factor = nullptr;

    Impl() { cholmod_start(&common); }
    ~Impl() {
        cholmod_free_factor(&factor, &common);
        cholmod_free_sparse(&matrix, &common);
        cholmod_finish(&common);
    }
};

BlockCholesky::BlockCholesky(const BlockMatrix& pattern) : impl_(std::make_unique<Impl>()) {
    cholmod_common& common = impl_->common;
    common.nmethods = 2;
    common.method[0].ordering = CHOLMOD_NATURAL;
    common.method[1].ordering = CHOLMOD_AMD;
    common.postorder = true;
    common.final_ll = true;  // L L^T fails where L D L^T would accept an indefinite matrix
    common.print = 0;
    common.quick_return_if_not_posdef = true;
    // Diagonal blocks are stored whole; CHOLMOD ignores what lies above the diagonal.
    impl_->matrix = cholmod_allocate_sparse(pattern.size(), pattern.size(), pattern.values_.size(),
                                            true, true, -1, CHOLMOD_REAL, &common);
    int* starts = static_cast<int*>(impl_->matrix->p);
    int* indices = static_cast<int*>(impl_->matrix->i);
    int scalar_col = 0, next = 0;
    for (size_t col = 0; col < pattern.rows_.size(); ++col)
        for (int c = 0; c < pattern.dim(static_cast<int>(col)); ++c) {
            starts[scalar_col++] = next;
            for (int row : pattern.rows_[col])
                for (int r = pattern.offsets_[row]; r < pattern.offsets_[row + 1]; ++r)
                    indices[next++] = r;
        }
    starts[scalar_col] = next;
    impl_->factor = cholmod_analyze(impl_->matrix, &common);
    if (!impl_->factor) throw std::runtime_error("CHOLMOD: symbolic analysis failed");
}

BlockCholesky::~BlockCholesky() = default;

bool BlockCholesky::factorize(const BlockMatrix& matrix) {
    const SerialKernels serial;
    std::memcpy(impl_->matrix->x, matrix.values_.data(), matrix.values_.size() * sizeof(double));
    cholmod_factorize(impl_->matrix, impl_->factor, &impl_->common);
    return impl_->common.status == CHOLMOD_OK && impl_->factor->minor == impl_->factor->n;
}

Eigen::MatrixXd BlockCholesky::solve(const Eigen::MatrixXd& b) const {
    const SerialKernels serial;
    cholmod_dense rhs{};
    rhs.nrow = b.rows();
    rhs.ncol = b.cols();
    rhs.d = b.rows();
    rhs.nzmax = b.size();
    rhs.x = const_cast<double*>(b.data());
    rhs.xtype = CHOLMOD_REAL;
    rhs.dtype = CHOLMOD_DOUBLE;
    cholmod_dense* x = cholmod_solve(CHOLMOD_A, impl_->factor, &rhs, &impl_->common);
    if (!x) throw std::runtime_error("CHOLMOD: solve failed");
    Eigen::MatrixXd result =
        Eigen::Map<const Eigen::MatrixXd>(static_cast<double*>(x->x), b.rows(), b.cols());
    cholmod_free_dense(&x, &impl_->common);
    return result;
}

double BlockCholesky::reciprocal_condition() const {
    return cholmod_rcond(impl_->factor, &impl_->common);
}

BlockCholesky::SparseInverse BlockCholesky::sparse_inverse() const {
    // With P A P^T = L L^T, going from the last column to the first:
    //   Z_ij = -sum_k>j Z_ik L_kj / L_jj  (i in the pattern of column j),
    //   Z_jj = (1/L_jj - sum_k>j L_kj Z_kj) / L_jj.
    cholmod_common& common = impl_->common;
    cholmod_factor* L = cholmod_copy_factor(impl_->factor, &common);
    cholmod_change_factor(CHOLMOD_REAL, true, false, true, true, L, &common);
    const int n = static_cast<int>(L->n);
    const int* Lp = static_cast<int*>(L->p);
    const int* Li = static_cast<int*>(L->i);
    const double* Lx = static_cast<double*>(L->x);
    const int* permutation = static_cast<int*>(L->Perm);

    SparseInverse Z;
    Z.starts_.assign(Lp, Lp + n + 1);
    Z.rows_.assign(Li, Li + Lp[n]);
    Z.values_.assign(Lp[n], 0.0);
    Z.inverse_permutation_.resize(n);
    for (int k = 0; k < n; ++k) Z.inverse_permutation_[permutation[k]] = k;

    std::vector<double> column(n, 0.0), sum(n, 0.0);
    for (int j = n - 1; j >= 0; --j) {
        const int begin = Lp[j], end = Lp[j + 1];
        for (int a = begin + 1; a < end; ++a) column[Li[a]] = Lx[a];
        for (int a = begin + 1; a < end; ++a) {
            const int k = Li[a];
            // Column k of Z restricted to the pattern of column j: a superset of what is needed,
            // in which entries outside the pattern meet a zero in `column` or are never read.
            const double L_kj = Lx[a];
            double from_below = 0;
            for (int b = Lp[k] + 1; b < Lp[k + 1]; ++b) {
                sum[Li[b]] += Z.values_[b] * L_kj;
                from_below += Z.values_[b] * column[Li[b]];
            }
            sum[k] += Z.values_[Lp[k]] * L_kj + from_below;
        }
        const double inverse_diagonal = 1 / Lx[begin];
        double diagonal = inverse_diagonal;
        for (int a = begin + 1; a < end; ++a) {
            Z.values_[a] = -sum[Li[a]] * inverse_diagonal;
            diagonal -= Lx[a] * Z.values_[a];
        }
        Z.values_[begin] = diagonal * inverse_diagonal;
        for (int a = begin + 1; a < end; ++a) {
            column[Li[a]] = 0;
            const int k = Li[a];
            sum[k] = 0;
            for (int b = Lp[k] + 1; b < Lp[k + 1]; ++b) sum[Li[b]] = 0;
        }
    }
    cholmod_free_factor(&L, &common);
    return Z;
}

double BlockCholesky::SparseInverse::entry(int row, int col) const {
    int r = inverse_permutation_[row], c = inverse_permutation_[col];
    if (r < c) std::swap(r, c);
    const auto begin = rows_.begin() + starts_[c], end = rows_.begin() + starts_[c + 1];
    const auto it = std::lower_bound(begin, end, r);
    if (it == end || *it != r)
        throw std::logic_error("inverse entry outside the pattern of the factor");
    return values_[it - rows_.begin()];
}

Eigen::MatrixXd BlockCholesky::SparseInverse::block(int row_begin, int rows, int col_begin,
                                                    int cols) const {
    Eigen::MatrixXd result(rows, cols);
    for (int c = 0; c < cols; ++c)
        for (int r = 0; r < rows; ++r) result(r, c) = entry(row_begin + r, col_begin + c);
    return result;
}

}  // namespace vio::batch
