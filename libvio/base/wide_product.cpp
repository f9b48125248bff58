#include "libvio/base/wide_product.h"

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <new>

namespace vio::blas {

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)

#define VIO_WIDE __attribute__((target("arch=x86-64-v4")))

namespace {

typedef double Pack __attribute__((vector_size(64), aligned(8), may_alias));
constexpr int kPack = 8;
// A tile of C: its sums fill 24 of the 32 registers. Rows are in packs.
constexpr int kPacks = 3, kTileRows = kPacks * kPack, kTileColumns = 8;
constexpr int kShallowest = 24;  // less does not pay for packing
constexpr int kDepth = 192;      // so that a panel of A stays in the first cache

int panels(int count, int width) {
    return (count + width - 1) / width;
}

// Rows of M, `width` of each column after one another, what is missing in the last panel zero.
template <int width>
VIO_WIDE void pack(const double* M, int stride, int rows, int columns, double scale, double* out) {
    for (int first = 0; first < rows; first += width) {
        const int count = std::min(width, rows - first);
        for (int k = 0; k < columns; ++k, out += width) {
            const double* from = M + first + static_cast<long>(k) * stride;
            if (count == width) {
                for (int i = 0; i < width; ++i) out[i] = scale * from[i];
                continue;
            }
            for (int i = 0; i < count; ++i) out[i] = scale * from[i];
            std::fill(out + count, out + width, 0.0);
        }
    }
}

// C += A B^T for one tile; A and B packed. C: all of the tile.
VIO_WIDE void add_tile(const double* A, const double* B, int depth, double* C, int ldc) {
    Pack sum[kTileColumns][kPacks] = {};
    for (int k = 0; k < depth; ++k, A += kTileRows, B += kTileColumns) {
        Pack a[kPacks];
        for (int i = 0; i < kPacks; ++i) a[i] = *reinterpret_cast<const Pack*>(A + i * kPack);
        for (int j = 0; j < kTileColumns; ++j)
            for (int i = 0; i < kPacks; ++i) sum[j][i] += a[i] * B[j];
    }
    for (int j = 0; j < kTileColumns; ++j)
        for (int i = 0; i < kPacks; ++i)
            *reinterpret_cast<Pack*>(C + i * kPack + static_cast<long>(j) * ldc) += sum[j][i];
}

// Work space of a thread, on a border of cache lines.
double* work_space(std::size_t size) {
    struct Free {
        void operator()(double* p) const { std::free(p); }
    };
    thread_local std::unique_ptr<double, Free> space;
    thread_local std::size_t capacity = 0;
    constexpr std::size_t kLine = 64;
    if (size > capacity) {
        const std::size_t bytes = (size * sizeof(double) + kLine - 1) / kLine * kLine;
        space.reset(static_cast<double*>(std::aligned_alloc(kLine, bytes)));
        if (!space) throw std::bad_alloc();
        capacity = size;
    }
    return space.get();
}

}  // namespace

bool wide_product_pays(int rows, int columns, int depth) {
    static const bool has =
        __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
        __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw") &&
        __builtin_cpu_supports("avx512cd");
    return has && rows >= 2 * kTileRows && columns >= 2 * kTileColumns && depth >= kShallowest;
}

void add_wide_product(double alpha, int rows, int columns, int depth, const double* A, int lda,
                      const double* B, int ldb, double* C, int ldc, bool lower) {
    const int row_panels = panels(rows, kTileRows), column_panels = panels(columns, kTileColumns);
    const std::size_t most = static_cast<std::size_t>(std::min(depth, kDepth));
    double* const packed_A = work_space(
        most * static_cast<std::size_t>(row_panels * kTileRows + column_panels * kTileColumns));
    double* const packed_B = packed_A + most * static_cast<std::size_t>(row_panels * kTileRows);
    for (int k = 0; k < depth; k += kDepth) {
        const int count = std::min(kDepth, depth - k);
        pack<kTileRows>(A + static_cast<long>(k) * lda, lda, rows, count, 1, packed_A);
        pack<kTileColumns>(B + static_cast<long>(k) * ldb, ldb, columns, count, alpha, packed_B);
        for (int row = 0; row < rows; row += kTileRows) {
            const int height = std::min(kTileRows, rows - row);
            const int end = lower ? std::min(columns, row + height) : columns;
            for (int column = 0; column < end; column += kTileColumns) {
                const double* tile_A = packed_A + static_cast<long>(row) * count;
                const double* tile_B = packed_B + static_cast<long>(column) * count;
                double* tile_C = C + row + static_cast<long>(column) * ldc;
                const int width = std::min(kTileColumns, columns - column);
                const bool below = !lower || column + kTileColumns <= row + 1;
                if (height == kTileRows && width == kTileColumns && below) {
                    add_tile(tile_A, tile_B, count, tile_C, ldc);
                    continue;
                }
                double part[kTileRows * kTileColumns] = {};
                add_tile(tile_A, tile_B, count, part, kTileRows);
                for (int j = 0; j < width; ++j)
                    for (int i = lower ? std::max(0, column + j - row) : 0; i < height; ++i)
                        tile_C[i + static_cast<long>(j) * ldc] += part[i + j * kTileRows];
            }
        }
    }
}

#else

bool wide_product_pays(int, int, int) {
    return false;
}

void add_wide_product(double, int, int, int, const double*, int, const double*, int, double*, int,
                      bool) {}

#endif

}  // namespace vio::blas
