#include "libvio/recursive/carrier.h"

#include "libvio/base/each_processor.h"

namespace vio {
namespace {

typedef double Pair __attribute__((vector_size(16), aligned(8), may_alias));

// T: count x 3, column-major; M's columns are `stride` apart.
VIO_EACH_PROCESSOR
void columns_times(const double* T, int count, double* M, long stride, int rows) {
    const double *T0 = T, *T1 = T + count, *T2 = T1 + count;
    int i = 0;
    for (; i + kPack <= rows; i += kPack) {
        double* entry = M + i;
        const Pack r0 = *reinterpret_cast<const Pack*>(entry),
                   r1 = *reinterpret_cast<const Pack*>(entry + stride),
                   r2 = *reinterpret_cast<const Pack*>(entry + 2 * stride);
        for (int k = 0; k < count; ++k, entry += stride) {
            Pack sum = T0[k] * r0 + T1[k] * r1 + T2[k] * r2;
            if (k >= 3) sum += *reinterpret_cast<const Pack*>(entry);
            *reinterpret_cast<Pack*>(entry) = sum;
        }
    }
    for (; i < rows; ++i) {
        const double r0 = M[i], r1 = M[stride + i], r2 = M[2 * stride + i];
        for (int k = 0; k < 3; ++k) M[k * stride + i] = T0[k] * r0 + T1[k] * r1 + T2[k] * r2;
        for (int k = 3; k < count; ++k) M[k * stride + i] += T0[k] * r0 + T1[k] * r1 + T2[k] * r2;
    }
}

VIO_EACH_PROCESSOR
void times_rows(const double* T, int count, double* M, long stride, int columns) {
    const double *T0 = T, *T1 = T + count, *T2 = T1 + count;
    for (; columns > 0; --columns, M += stride) {
        const double r0 = M[0], r1 = M[1], r2 = M[2];
        for (int k = 0; k < 3; ++k) M[k] = T0[k] * r0 + T1[k] * r1 + T2[k] * r2;
        int k = 3;
        for (; k + 1 < count; k += 2)
            *reinterpret_cast<Pair*>(M + k) += *reinterpret_cast<const Pair*>(T0 + k) * r0 +
                                               *reinterpret_cast<const Pair*>(T1 + k) * r1 +
                                               *reinterpret_cast<const Pair*>(T2 + k) * r2;
        if (k < count) M[k] += T0[k] * r0 + T1[k] * r1 + T2[k] * r2;
    }
}

}  // namespace

void carry_columns(blas::Matrix M, const Carrier& T) {
    columns_times(T.data(), static_cast<int>(T.rows()), M.data(), M.outerStride(),
                  static_cast<int>(M.rows()));
}

void carry_rows(blas::Matrix M, const Carrier& T) {
    times_rows(T.data(), static_cast<int>(T.rows()), M.data(), M.outerStride(),
               static_cast<int>(M.cols()));
}

}  // namespace vio
