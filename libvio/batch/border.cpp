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
    SharedErrors& solution = rig_solution_.emplace();
    solution.covariance = scale.asDiagonal() * scaled.inverse() * scale.asDiagonal();
    solution.reduced = -solved;
    solution.points = moved_points(solution.reduced, &rig->points);
}

// How points move with what moves the reduced unknowns; own: columns of the points' equations.
MatrixXd NormalEquations::moved_points(const MatrixXd& reduced, const MatrixXd* own) const {
    MatrixXd points(3 * static_cast<Index>(V.size()), reduced.cols());
    for (size_t j = 0; j < V.size(); ++j) {
        auto moved = points.middleRows<3>(3 * static_cast<Index>(j));
        if (const int slot = layout_.border_of_point[j]; slot >= 0) {
            moved = reduced.middleRows<3>(matrix.offset(layout_.border_block(slot)));
            continue;
        }
        MatrixXd sum = MatrixXd::Zero(3, reduced.cols());
        if (own) sum = own->middleRows<3>(3 * static_cast<Index>(j));
        const Point& point = model_.points[j];
        for (int k = point.first_observation; k < point.first_observation + point.observation_count;
             ++k)
            sum.noalias() += W[k].transpose() * reduced.middleRows<6>(layout_.index(
                                                    model_.observations[k].frame_idx, 0));
        moved = -point_inverse(static_cast<int>(j)) * sum;
    }
    return points;
}

// The errors that c^T x = 1 takes along, of the rig's and of the reduced unknowns beside what they
// share with those, grow together: u = P c / (c^T P c).
void NormalEquations::widen(const VectorXd& c, double factor) {
    const VectorXd own = factor_.solve(MatrixXd(c));
    const Index rig_unknowns = shared_errors_ ? shared_errors_->covariance.rows() : 0;
    VectorXd shared(rig_unknowns);
    double variance = c.dot(own);
    if (rig_unknowns > 0) {
        const VectorXd by_shared = shared_errors_->reduced.transpose() * c;
        shared = shared_errors_->covariance * by_shared;
        variance += by_shared.dot(shared);
    } else {
        shared_errors_ = SharedErrors{MatrixXd(0, 0), MatrixXd(c.size(), 0),
                                      MatrixXd(3 * static_cast<Index>(V.size()), 0)};
    }
    VectorXd moved(rig_unknowns + 1);
    moved << shared / variance, 1;
    SharedErrors& errors = *shared_errors_;
    errors.covariance.conservativeResizeLike(MatrixXd::Zero(rig_unknowns + 1, rig_unknowns + 1));
    errors.covariance += (factor - 1) * variance * moved * moved.transpose();
    errors.reduced.conservativeResize(Eigen::NoChange, rig_unknowns + 1);
    errors.reduced.rightCols<1>() = own / variance;
    errors.points.conservativeResize(Eigen::NoChange, rig_unknowns + 1);
    errors.points.rightCols<1>() = moved_points(own / variance, nullptr);
}

MatrixXd NormalEquations::covariance(const MatrixXd& E) const {
    MatrixXd C = E.transpose() * factor_.solve(E);
    if (!shared_errors_) return C;
    const MatrixXd moved = E.transpose() * shared_errors_->reduced;
    return C + moved * shared_errors_->covariance * moved.transpose();
}

}  // namespace vio::batch
