// Unknowns of the rig beside those of the normal equations: block elimination with the
// factorisation that is there. With columns C of the border, C~ = C - W V^-1 C_points and S the
// reduced matrix,
//   (H - C~^T S^-1 C~ - C_points^T V^-1 C_points) dy = -(h - C~^T S^-1 s - C_points^T V^-1 b).
#include "libvio/batch/normal_equations.h"

namespace vio::batch {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Columns of the reduced system.
MatrixXd NormalEquations::reduced_rig() const {
    MatrixXd columns = rig->reduced;
    for (size_t j = 0; j < V.size(); ++j) {
        const auto C = rig->points.middleRows<3>(3 * static_cast<Index>(j));
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

// From C~ and S^-1 C~.
MatrixXd NormalEquations::rig_information(const MatrixXd& columns, const MatrixXd& solved) const {
    MatrixXd H = rig->H - columns.transpose() * solved;
    for (size_t j = 0; j < V.size(); ++j) {
        if (layout_.border_of_point[j] >= 0) continue;
        const auto C = rig->points.middleRows<3>(3 * static_cast<Index>(j));
        H.noalias() -= C.transpose() * (point_inverse(static_cast<int>(j)) * C).eval();
    }
    return H;
}

// Adds to the step of the reduced unknowns, which stands for the rig as it is.
bool NormalEquations::solve_rig(Step& step) const {
    const MatrixXd columns = reduced_rig(), solved = factor_.solve(columns);
    MatrixXd H = rig_information(columns, solved);
    VectorXd g = rig->gradient + columns.transpose() * step.reduced;
    for (size_t j = 0; j < V.size(); ++j) {
        if (layout_.border_of_point[j] >= 0) continue;
        g.noalias() -= rig->points.middleRows<3>(3 * static_cast<Index>(j)).transpose() *
                       (point_inverse(static_cast<int>(j)) * b[j]);
    }
    for (Index k = 0; k < H.rows(); ++k) H(k, k) += damping(rig->H(k, k));
    const Eigen::LLT<MatrixXd> llt(H);
    if (llt.info() != Eigen::Success) return false;
    step.rig = -llt.solve(g);
    step.reduced.noalias() -= solved * step.rig;
    return step.rig.allFinite();
}

void NormalEquations::solve_rig_covariance() {
    constexpr double kSmallest = 1e-13;  // share of the information that survives elimination
    const MatrixXd columns = reduced_rig(), solved = factor_.solve(columns);
    // In unknowns scaled to unit information, as their units differ by orders.
    const VectorXd scale = rig->H.diagonal().cwiseSqrt().cwiseInverse();
    const MatrixXd scaled =
        scale.asDiagonal() * rig_information(columns, solved) * scale.asDiagonal();
    if (!scaled.allFinite()) return;
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scaled);
    Index weakest = 0;
    eigen.eigenvectors().col(0).cwiseAbs().maxCoeff(&weakest);
    weakest_rig_unknown_ = static_cast<int>(weakest);
    if (!(eigen.eigenvalues()(0) > kSmallest)) return;
    BorderSolution& solution = rig_solution_.emplace();
    solution.covariance = scale.asDiagonal() * scaled.inverse() * scale.asDiagonal();
    solution.reduced = -solved;
    solution.points.resize(rig->points.rows(), rig->points.cols());
    for (size_t j = 0; j < V.size(); ++j) {
        auto moved = solution.points.middleRows<3>(3 * static_cast<Index>(j));
        if (const int slot = layout_.border_of_point[j]; slot >= 0) {
            moved = solution.reduced.middleRows<3>(matrix.offset(layout_.border_block(slot)));
            continue;
        }
        MatrixXd sum = rig->points.middleRows<3>(3 * static_cast<Index>(j));
        const Point& point = model_.points[j];
        for (int k = point.first_observation; k < point.first_observation + point.observation_count;
             ++k)
            sum.noalias() += W[k].transpose() * solution.reduced.middleRows<6>(layout_.index(
                                                    model_.observations[k].frame_idx, 0));
        moved = -point_inverse(static_cast<int>(j)) * sum;
    }
}

MatrixXd NormalEquations::covariance(const MatrixXd& E) const {
    MatrixXd C = E.transpose() * factor_.solve(E);
    if (!rig_solution_) return C;
    const MatrixXd moved = E.transpose() * rig_solution_->reduced;
    return C + moved * rig_solution_->covariance * moved.transpose();
}

}  // namespace vio::batch
