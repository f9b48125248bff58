// Dense products on the machine's BLAS (but for combine()), which is made for the very processor,
// as this program, for all of its kind, is not. Column-major; a matrix with L is lower triangular,
// what stands above its diagonal is neither read nor written.
#pragma once

#include <Eigen/Dense>

namespace vio::blas {

/// BLAS on one thread while this lives: at our sizes waking and awaiting threads costs more than
/// half of the time on an idle machine and ten times the work on a busy one. (The setting is the
/// process's; the last that ends restores it.)
class Serial {
 public:
    Serial();
    ~Serial();
    Serial(const Serial&) = delete;
    Serial& operator=(const Serial&) = delete;
};

using Matrix = Eigen::Ref<Eigen::MatrixXd>;
using ConstMatrix = Eigen::Ref<const Eigen::MatrixXd>;

/// C -= A A^T, lower triangle.
void subtract_square(const ConstMatrix& A, Matrix C);
/// C += alpha A B^T.
void add_product(double alpha, const ConstMatrix& A, const ConstMatrix& B, Matrix C);
/// A x with A symmetric, of which the lower triangle is read.
Eigen::VectorXd symmetric_times(const ConstMatrix& A, const Eigen::VectorXd& x);
/// A += alpha x x^T, lower triangle.
void add_square(double alpha, const Eigen::VectorXd& x, Matrix A);
/// A += x y^T + y x^T, lower triangle.
void add_pair(const Eigen::VectorXd& x, const Eigen::VectorXd& y, Matrix A);
/// C <- A S^T with few columns of A that stand apart, in loops of our own since BLAS has none for
/// it: `columns` lists the `count` columns of A, each of `rows` entries; S: 2 x count,
/// column-major. The two columns of C overlap none of A's.
void combine(const double* const* columns, const double* S, int count, int rows, double* C_first,
             double* C_second);
/// B <- B L^-T.
void divide(const ConstMatrix& L, Matrix B);
/// L L^T <- L L^T + sign x x^T, sign: 1 or -1. False where that is not positive definite. In loops
/// of our own, too.
bool update_factor(Matrix L, Eigen::VectorXd x, double sign);
/// Cholesky's factor of the square on top of a panel A, lower triangle, in its place; its rows
/// below become theirs times L^-T. False where the square is not positive definite.
bool factorize(Matrix A);

}  // namespace vio::blas
