// Work cut into pieces that do not depend on the number of threads, so that results do not either.
#pragma once

#include <algorithm>

#include "libvio/base/at_once.h"

namespace vio::batch {

/// Pieces that loops over points and over intervals are cut into.
constexpr int kPieces = 16;

/// Calls work(piece) for 0 <= piece < pieces, thread k taking pieces k, k + threads, ....
template <typename Work>
void in_parallel(int threads, int pieces, Work work) {
    const int used = std::min(threads, pieces);
    at_once(used, [&](int thread) {
        for (int piece = thread; piece < pieces; piece += used) work(piece);
    });
}

/// First element of a piece when `count` elements are cut into `pieces`.
inline int piece_begin(int count, int pieces, int piece) {
    return static_cast<int>(static_cast<long>(count) * piece / pieces);
}

}  // namespace vio::batch
