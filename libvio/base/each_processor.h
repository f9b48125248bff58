// Functions that are compiled for several generations of processors; which is chosen when the
// program starts. Without Eigen in them: its inline functions must look the same everywhere in the
// program.
#pragma once

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define VIO_EACH_PROCESSOR \
    __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define VIO_EACH_PROCESSOR
#endif

namespace vio {

/// Numbers for one instruction, as far as there is one: GCC makes as many of the processor's
/// registers of it as it takes.
typedef double Pack __attribute__((vector_size(64), aligned(8), may_alias));
inline constexpr int kPack = sizeof(Pack) / sizeof(double);

}  // namespace vio
