// Covariances carried from one mean to another: P <- T P T^T, where T is the identity but for the
// columns of a rotation; see the head of filter_state.h.
#pragma once

#include <Eigen/Dense>

#include "libvio/base/blas.h"
#include "libvio/recursive/core_state.h"

namespace vio {

/// The first columns of T; the others are those of the identity.
using Carrier = Eigen::Matrix<double, Eigen::Dynamic, 3, 0, kMaxCore, 3>;

/// M <- M T^T; M has as many columns as T has rows.
void carry_columns(blas::Matrix M, const Carrier& T);
/// M <- T M; M has as many rows as T.
void carry_rows(blas::Matrix M, const Carrier& T);

}  // namespace vio
