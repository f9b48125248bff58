// Further unknowns beside those of the normal equations: block elimination with the factorisation
// that is there. With columns C of the border, C~ = C - W V^-1 C_points and S the reduced matrix,
//   (H - C~^T S^-1 C~ - C_points^T V^-1 C_points) dy = -(h - C~^T S^-1 s - C_points^T V^-1 b).
#include "libvio/batch/normal_equations.h"

namespace vio::batch {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Columns of the reduced system.
MatrixXd NormalEquations::reduced(const Border& border) const {
    MatrixXd columns = border.reduced;
    for (size_t j = 0; j < V.size(); ++j) {
        const MatrixXd C = border.points.middleRows<3>(3 * static_cast<Eigen::Index>(j));
        if (const int slot = layout_.border_of_point[j]; slot >= 0) {
            columns.middleRows<3>(matrix.offset(layout_.border_block(slot))) += C;
            continue;
        }
        const MatrixXd scaled = point_inverse(static_cast<int>(j)) * C;
        const Point& point = model_.points[j];
        for (int k = point.first_observation; k < point.first_observation + point.observation_count;
             ++k)
            columns.middleRows<6>(layout_.index(model_.observations[k].frame_idx, 0)).noalias() -=
                W[k] * scaled;
    }
    return columns;
}

MatrixXd NormalEquations::information(const Border& border) const {
    const MatrixXd columns = reduced(border);
    MatrixXd H = border.H - columns.transpose() * factor_.solve(columns);
    for (size_t j = 0; j < V.size(); ++j) {
        if (layout_.border_of_point[j] >= 0) continue;
        const MatrixXd C = border.points.middleRows<3>(3 * static_cast<Eigen::Index>(j));
        H.noalias() -= C.transpose() * (point_inverse(static_cast<int>(j)) * C).eval();
    }
    return H;
}

bool NormalEquations::solve(double lambda, const Border& border, Step& step,
                            VectorXd& border_step) {
    if (!solve(lambda, step)) return false;
    const MatrixXd columns = reduced(border), Y = factor_.solve(columns);
    MatrixXd H = border.H - columns.transpose() * Y;
    VectorXd g = border.gradient + columns.transpose() * step.reduced;
    for (size_t j = 0; j < V.size(); ++j) {
        if (layout_.border_of_point[j] >= 0) continue;
        const MatrixXd C = border.points.middleRows<3>(3 * static_cast<Eigen::Index>(j)),
                       scaled = point_inverse(static_cast<int>(j)) * C;
        H.noalias() -= C.transpose() * scaled;
        g.noalias() -= scaled.transpose() * b[j];
    }
    for (Eigen::Index k = 0; k < H.rows(); ++k) H(k, k) += damping(border.H(k, k));
    const Eigen::LLT<MatrixXd> llt(H);
    if (llt.info() != Eigen::Success) return false;
    border_step = -llt.solve(g);
    const VectorXd change = -Y * border_step;
    step.reduced += change;
    for (size_t j = 0; j < V.size(); ++j) {
        Eigen::Vector3d& moved = step.points[j];
        if (const int slot = layout_.border_of_point[j]; slot >= 0) {
            moved = step.reduced.segment<3>(matrix.offset(layout_.border_block(slot)));
            continue;
        }
        Eigen::Vector3d rhs =
            border.points.middleRows<3>(3 * static_cast<Eigen::Index>(j)) * border_step;
        const Point& point = model_.points[j];
        for (int k = point.first_observation; k < point.first_observation + point.observation_count;
             ++k)
            rhs.noalias() += W[k].transpose() *
                             change.segment<6>(layout_.index(model_.observations[k].frame_idx, 0));
        moved -= point_inverse(static_cast<int>(j)) * rhs;
    }
    return step.reduced.allFinite() && border_step.allFinite();
}

}  // namespace vio::batch
