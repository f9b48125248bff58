// C += alpha A B^T in the 512-bit registers of processors that the BLAS at hand does not know: that
// of Debian 12 takes all of AMD's for ones with half as wide registers. Column-major.
#pragma once

namespace vio::blas {

/// Whether this processor has them, and for sizes like these they pay.
bool wide_product_pays(int rows, int columns, int depth);

/// A: rows x depth, B: columns x depth. lower: of C what is on and below the diagonal, the rest is
/// neither read nor written. Only where the processor has such registers.
void add_wide_product(double alpha, int rows, int columns, int depth, const double* A, int lda,
                      const double* B, int ldb, double* C, int ldc, bool lower);

}  // namespace vio::blas
