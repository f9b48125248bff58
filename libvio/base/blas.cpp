#include "libvio/base/blas.h"

#include <algorithm>
#include <cmath>
#include <mutex>

#include "libvio/base/each_processor.h"

extern "C" {
void dsyrk_(const char* uplo, const char* trans, const int* n, const int* k, const double* alpha,
            const double* a, const int* lda, const double* beta, double* c, const int* ldc);
void dgemm_(const char* transa, const char* transb, const int* m, const int* n, const int* k,
            const double* alpha, const double* a, const int* lda, const double* b, const int* ldb,
            const double* beta, double* c, const int* ldc);
void dtrsm_(const char* side, const char* uplo, const char* trans, const char* diag, const int* m,
            const int* n, const double* alpha, const double* a, const int* lda, double* b,
            const int* ldb);
void dsymv_(const char* uplo, const int* n, const double* alpha, const double* a, const int* lda,
            const double* x, const int* incx, const double* beta, double* y, const int* incy);
void dsyr_(const char* uplo, const int* n, const double* alpha, const double* x, const int* incx,
           double* a, const int* lda);
void dsyr2_(const char* uplo, const int* n, const double* alpha, const double* x, const int* incx,
            const double* y, const int* incy, double* a, const int* lda);
// Of OpenBLAS, where it is the BLAS; null otherwise.
[[gnu::weak]] void openblas_set_num_threads(int threads);
[[gnu::weak]] int openblas_get_num_threads();
}

namespace vio::blas {
namespace {

constexpr double kZero = 0, kOne = 1, kMinusOne = -1;
constexpr int kNext = 1;  // from an entry of a vector to the next

std::mutex serial_mutex;
int serial_count = 0, threads_before = 1;

int stride(const ConstMatrix& A) {
    return std::max(1, static_cast<int>(A.outerStride()));
}

// a, b <- (a + sign s b) / c, c b - s times that.
VIO_EACH_PROCESSOR
void rotate(double* __restrict a, double* __restrict b, int n, double c, double s, double sign) {
    const double inverse = 1 / c, share = sign * s * inverse;
    for (int i = 0; i < n; ++i) {
        a[i] = inverse * a[i] + share * b[i];
        b[i] = c * b[i] - s * a[i];
    }
}

}  // namespace

Serial::Serial() {
    if (!openblas_set_num_threads || !openblas_get_num_threads) return;
    const std::lock_guard<std::mutex> lock(serial_mutex);
    if (serial_count++ > 0) return;
    threads_before = openblas_get_num_threads();
    if (threads_before != 1) openblas_set_num_threads(1);
}

Serial::~Serial() {
    if (!openblas_set_num_threads || !openblas_get_num_threads) return;
    const std::lock_guard<std::mutex> lock(serial_mutex);
    if (--serial_count == 0 && threads_before != 1) openblas_set_num_threads(threads_before);
}

void subtract_square(const ConstMatrix& A, Matrix C) {
    const int n = static_cast<int>(A.rows()), k = static_cast<int>(A.cols());
    const int lda = stride(A), ldc = stride(C);
    if (n > 0 && k > 0) dsyrk_("L", "N", &n, &k, &kMinusOne, A.data(), &lda, &kOne, C.data(), &ldc);
}

void add_product(double alpha, const ConstMatrix& A, const ConstMatrix& B, Matrix C) {
    const int m = static_cast<int>(A.rows()), n = static_cast<int>(B.rows()),
              k = static_cast<int>(A.cols());
    const int lda = stride(A), ldb = stride(B), ldc = stride(C);
    if (m > 0 && n > 0 && k > 0)
        dgemm_("N", "T", &m, &n, &k, &alpha, A.data(), &lda, B.data(), &ldb, &kOne, C.data(), &ldc);
}

Eigen::VectorXd symmetric_times(const ConstMatrix& A, const Eigen::VectorXd& x) {
    const int n = static_cast<int>(A.rows()), lda = stride(A);
    Eigen::VectorXd y = Eigen::VectorXd::Zero(n);
    if (n > 0) dsymv_("L", &n, &kOne, A.data(), &lda, x.data(), &kNext, &kZero, y.data(), &kNext);
    return y;
}

void add_square(double alpha, const Eigen::VectorXd& x, Matrix A) {
    const int n = static_cast<int>(A.rows()), lda = stride(A);
    if (n > 0) dsyr_("L", &n, &alpha, x.data(), &kNext, A.data(), &lda);
}

void add_pair(const Eigen::VectorXd& x, const Eigen::VectorXd& y, Matrix A) {
    const int n = static_cast<int>(A.rows()), lda = stride(A);
    if (n > 0) dsyr2_("L", &n, &kOne, x.data(), &kNext, y.data(), &kNext, A.data(), &lda);
}

VIO_EACH_PROCESSOR
void combine(const double* const* columns, const double* S, int count, int rows, double* C_first,
             double* C_second) {
    int r = 0;
    for (; r + kPack <= rows; r += kPack) {
        Pack first{}, second{};
        for (int k = 0; k < count; ++k) {
            const Pack entries = *reinterpret_cast<const Pack*>(columns[k] + r);
            first += S[2 * k] * entries;
            second += S[2 * k + 1] * entries;
        }
        *reinterpret_cast<Pack*>(C_first + r) = first;
        *reinterpret_cast<Pack*>(C_second + r) = second;
    }
    for (; r < rows; ++r) {
        double first = 0, second = 0;
        for (int k = 0; k < count; ++k) {
            first += S[2 * k] * columns[k][r];
            second += S[2 * k + 1] * columns[k][r];
        }
        C_first[r] = first;
        C_second[r] = second;
    }
}

void divide(const ConstMatrix& L, Matrix B) {
    const int m = static_cast<int>(B.rows()), n = static_cast<int>(B.cols());
    const int lda = stride(L), ldb = stride(B);
    if (m > 0 && n > 0) dtrsm_("R", "L", "T", "N", &m, &n, &kOne, L.data(), &lda, B.data(), &ldb);
}

bool update_factor(Matrix L, Eigen::VectorXd x, double sign) {
    for (Eigen::Index k = 0; k < L.cols(); ++k) {
        const double before = L(k, k), square = before * before + sign * x(k) * x(k);
        if (!(square > 0)) return false;
        L(k, k) = std::sqrt(square);
        rotate(L.col(k).data() + k + 1, x.data() + k + 1, static_cast<int>(L.rows() - k - 1),
               L(k, k) / before, x(k) / before, sign);
    }
    return true;
}

bool factorize(Matrix A) {
    constexpr Eigen::Index kWidth = 48;
    for (Eigen::Index k = 0; k < A.cols(); k += kWidth) {
        const Eigen::Index width = std::min(kWidth, A.cols() - k);
        const Eigen::Index columns = A.cols() - k - width, below = A.rows() - k - width;
        auto diagonal = A.block(k, k, width, width);
        Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kWidth, kWidth> square = diagonal;
        const Eigen::LLT<Eigen::Ref<decltype(square)>> llt(square);
        if (llt.info() != Eigen::Success) return false;
        diagonal.triangularView<Eigen::Lower>() = square;
        auto rows = A.block(k + width, k, below, width);
        divide(diagonal, rows);
        auto next = A.block(k + width, k + width, below, columns);
        subtract_square(rows.topRows(columns), next.topRows(columns));
        add_product(-1, rows.bottomRows(below - columns), rows.topRows(columns),
                    next.bottomRows(below - columns));
    }
    return true;
}

}  // namespace vio::blas
