// The batch estimator's normal equations as one dense matrix, to compare with.
#pragma once

#include "libvio/batch/normal_equations.h"

namespace vio::test {

inline Eigen::MatrixXd dense(batch::BlockMatrix& A, int blocks) {
    Eigen::MatrixXd D = Eigen::MatrixXd::Zero(A.size(), A.size());
    for (int col = 0; col < blocks; ++col)
        for (int row : A.rows(col))
            D.block(A.offset(row), A.offset(col), A.dim(row), A.dim(col)) = A.block(row, col);
    return D.selfadjointView<Eigen::Lower>();
}

/// Information of the reduced unknowns, of all points (three each), and of the rig's unknowns, if
/// there are any. Points of the border are counted as points; where they stand among the reduced
/// unknowns is the identity.
inline Eigen::MatrixXd dense_information(batch::NormalEquations& equations,
                                         const batch::Model& model) {
    const batch::Layout& layout = equations.layout();
    const int n = equations.matrix.size(), m = static_cast<int>(model.points.size()),
              r = equations.rig ? static_cast<int>(equations.rig->H.rows()) : 0;
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(n + 3 * m + r, n + 3 * m + r);
    H.topLeftCorner(n, n) = dense(equations.matrix, static_cast<int>(layout.block_dims().size()));
    for (int j = 0; j < m; ++j) H.block<3, 3>(n + 3 * j, n + 3 * j) = equations.V[j];
    for (size_t k = 0; k < model.observations.size(); ++k) {
        const batch::Observation& o = model.observations[k];
        const int row = layout.index(o.frame_idx, 0), col = n + 3 * o.point_idx;
        H.block<6, 3>(row, col) += equations.W[k];
        H.block<3, 6>(col, row) += equations.W[k].transpose();
    }
    for (int slot = 0; slot < layout.border_points; ++slot) {
        const int k = equations.matrix.offset(layout.border_block(slot));
        H.middleRows(k, 3).setZero();
        H.middleCols(k, 3).setZero();
        H.block<3, 3>(k, k).setIdentity();
    }
    if (r == 0) return H;
    H.bottomRows(r) << equations.rig->reduced.transpose(), equations.rig->points.transpose(),
        equations.rig->H;
    H.rightCols(r) = H.bottomRows(r).transpose().eval();
    return H;
}

/// Its inverse, by way of unknowns scaled to unit information, as their units differ by orders.
inline Eigen::MatrixXd dense_covariance(batch::NormalEquations& equations,
                                        const batch::Model& model) {
    const Eigen::MatrixXd H = dense_information(equations, model);
    const Eigen::VectorXd scale = H.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd scaled = scale.asDiagonal() * H * scale.asDiagonal();
    return scale.asDiagonal() * scaled.inverse() * scale.asDiagonal();
}

/// Gives c^T x, of the first unknowns x, `factor` times its variance, and all errors what they
/// share of it.
inline void widen(Eigen::MatrixXd& covariance, const Eigen::VectorXd& c, double factor) {
    const Eigen::VectorXd with_c = covariance.leftCols(c.size()) * c;
    covariance += (factor - 1) / c.dot(with_c.head(c.size())) * with_c * with_c.transpose();
}

}  // namespace vio::test
