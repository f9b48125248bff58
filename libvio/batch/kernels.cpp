#include "libvio/batch/kernels.h"

#include "libvio/base/each_processor.h"

namespace vio::batch::kernels {

VIO_EACH_PROCESSOR
void subtract_product(double* target, long stride, const double* T, const double* S, long T_stride,
                      int rows) {
    const double *t0 = T, *t1 = T + T_stride, *t2 = T + 2 * T_stride;
    for (int c = 0; c < 6; c += 2) {
        const double a0 = S[c], a1 = S[T_stride + c], a2 = S[2 * T_stride + c];
        const double b0 = S[c + 1], b1 = S[T_stride + c + 1], b2 = S[2 * T_stride + c + 1];
        double* __restrict__ a = target + c * stride;
        double* __restrict__ b = a + stride;
#ifdef __clang__
#pragma clang loop vectorize(assume_safety)
#else
#pragma GCC ivdep
#endif
        for (int r = 0; r < rows; ++r) {
            a[r] -= t0[r] * a0 + t1[r] * a1 + t2[r] * a2;
            b[r] -= t0[r] * b0 + t1[r] * b1 + t2[r] * b2;
        }
    }
}

VIO_EACH_PROCESSOR
void scale_term(const double* __restrict__ W, const double* __restrict__ Q,
                const double* __restrict__ q, double* __restrict__ Y, long stride,
                double* __restrict__ x) {
    double *y0 = Y, *y1 = Y + stride, *y2 = Y + 2 * stride;
    for (int r = 0; r < 6; ++r) {
        const double a = W[r] * Q[0];
        const double b = W[r] * Q[3] + W[r + 6] * Q[4];
        const double c = W[r] * Q[6] + W[r + 6] * Q[7] + W[r + 12] * Q[8];
        y0[r] = a;
        y1[r] = b;
        y2[r] = c;
        x[r] -= a * q[0] + b * q[1] + c * q[2];
    }
}

VIO_EACH_PROCESSOR
void add(double* __restrict__ target, const double* __restrict__ source, int count) {
    for (int k = 0; k < count; ++k) target[k] += source[k];
}

}  // namespace vio::batch::kernels
