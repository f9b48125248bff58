// The innermost loops of the batch estimator. They are compiled for several generations of
// processors and chosen when the program starts; hence plain arrays, no Eigen (whose inline
// functions must look the same everywhere in the program).
#pragma once

namespace vio::batch::kernels {

/// target(r, c) -= sum_k T(r, k) S(c, k) for rows r < rows, columns c < 6, k < 3.
/// target: column-major with `stride`; T: three columns `T_stride` apart; S: likewise.
void subtract_product(double* target, long stride, const double* T, const double* S, long T_stride,
                      int rows);

/// Y = W Q (both 6 x 3, column-major; Y's columns `stride` apart; Q upper triangular), x -= Y q.
void scale_term(const double* W, const double* Q, const double* q, double* Y, long stride,
                double* x);

/// target += source.
void add(double* target, const double* source, int count);

}  // namespace vio::batch::kernels
