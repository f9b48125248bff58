// Covariances carried from one mean to another: P <- T P T^T, where T is the identity but for the
// columns of a rotation; see the head of filter_state.h.
#pragma once

#include <Eigen/Dense>

#include "libvio/recursive/core_state.h"

namespace vio {

/// The first columns of T; the others are those of the identity.
using Carrier = Eigen::Matrix<double, Eigen::Dynamic, 3, 0, kMaxCore, 3>;

/// M <- M T^T; M has as many columns as T.
template <typename Columns>
void carry_columns(Columns M, const Carrier& T) {
    const Eigen::Matrix<double, Eigen::Dynamic, 3> rotation = M.template leftCols<3>();
    M.template leftCols<3>().noalias() = rotation.lazyProduct(T.topRows<3>().transpose());
    for (Eigen::Index i = 3; i < T.rows(); i += 3)
        M.template middleCols<3>(i).noalias() +=
            rotation.lazyProduct(T.middleRows<3>(i).transpose());
}

/// M <- T M; M has as many rows as T.
template <typename Rows>
void carry_rows(Rows M, const Carrier& T) {
    for (Eigen::Index j = 0; j < M.cols(); ++j) {
        const Eigen::Vector3d rotation = M.col(j).template head<3>();
        M.col(j).template head<3>().noalias() = T.topRows<3>() * rotation;
        for (Eigen::Index i = 3; i < T.rows(); i += 3)
            M.col(j).template segment<3>(i).noalias() += T.middleRows<3>(i) * rotation;
    }
}

}  // namespace vio
