// Normal equations of the batch problem with points eliminated by the Schur complement.
//
//   [ A   W ] [ dx ]     [ a ]
//   [ W^T V ] [ dX ] = - [ b ]     V block diagonal, one 3x3 block a point
//
// gives (A - W V^-1 W^T) dx = -(a - W V^-1 b), whose blocks are ordered by time with the global
// unknowns (border) last, and dX = -V^-1 (b + W^T dx) by back-substitution.
#pragma once

#include <vector>

#include "libvio/batch/block_matrix.h"
#include "libvio/batch/model.h"

namespace vio::batch {

using Matrix63d = Eigen::Matrix<double, 6, 3>;

struct Step {
    Eigen::VectorXd reduced;              ///< poses, velocities, biases, border points, gravity
    std::vector<Eigen::Vector3d> points;  ///< every point, border ones included
};

class NormalEquations {
 public:
    NormalEquations(const Model& model, const Layout& layout);

    const Layout& layout() const { return layout_; }

    // Filled by the objective's linearisation.
    void set_zero();
    BlockMatrix matrix;              ///< A, lower triangle
    Eigen::VectorXd gradient;        ///< a
    std::vector<Eigen::Matrix3d> V;  ///< of each point
    std::vector<Eigen::Vector3d> b;  ///< of each point
    std::vector<Matrix63d> W;        ///< of each observation: pose by point

    /// Takes a scalar unknown out of the problem (all its Jacobians must be zero).
    void hold(int scalar_idx) { matrix.diagonal(scalar_idx) += 1; }

    /// Damped step: solves with lambda diag(H) added (Marquardt). False if not positive definite.
    bool solve(double lambda, Step& step);
    /// Cost decrease that the linear model promises for a step of the last solve().
    double predicted_decrease(const Step& step) const;

    /// Undamped factorisation of the reduced system, for covariances.
    bool factorize();
    const BlockCholesky& factor() const { return factor_; }
    /// V^-1 of an eliminated point.
    const Eigen::Matrix3d& point_inverse(int point_idx) const { return V_inverse_[point_idx]; }

 private:
    static BlockMatrix make_matrix(const Model& model, const Layout& layout);
    bool eliminate(double lambda);
    void eliminate_point(int point_idx);
    double damping(double diagonal) const;

    const Model& model_;
    Layout layout_;
    BlockMatrix reduced_;
    BlockCholesky factor_;
    Eigen::VectorXd reduced_gradient_;
    std::vector<Eigen::Matrix3d> V_inverse_;
    std::vector<int> pair_positions_;  // of each pair of observations of eliminated points
    std::vector<size_t> first_pair_;   // of each point
    Eigen::VectorXd reduced_diagonal_;
    double lambda_ = 0;
};

}  // namespace vio::batch
