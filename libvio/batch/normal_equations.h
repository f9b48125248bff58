// Normal equations of the batch problem with points eliminated by the Schur complement.
//
//   [ A   W ] [ dx ]     [ a ]
//   [ W^T V ] [ dX ] = - [ b ]     V block diagonal, one 3x3 block a point
//
// gives (A - W V^-1 W^T) dx = -(a - W V^-1 b) and dX = -V^-1 (b + W^T dx) by back-substitution. The
// left side is never formed as a whole: points enter the factorisation where their images do.
#pragma once

#include <optional>
#include <vector>

#include "libvio/batch/block_cholesky.h"
#include "libvio/batch/model.h"

namespace vio::batch {

/// Changes of all unknowns, in their tangent spaces.
struct Step {
    Eigen::VectorXd reduced;              ///< poses, velocities, biases, border points, gravity
    std::vector<Eigen::Vector3d> points;  ///< every point, border ones included
    Eigen::VectorXd rig;                  ///< unknowns of the rig, if there are any

    Step& operator*=(double length);
};

/// Columns of the normal equations of further unknowns that couple with all others; see
/// Objective::linearize_rig().
struct Border {
    Eigen::MatrixXd reduced;  ///< rows as `gradient`, without what comes by the points
    Eigen::MatrixXd points;   ///< three rows for each point
    Eigen::MatrixXd H;        ///< of these unknowns themselves
    Eigen::VectorXd gradient;
};

/// Errors that others share: beside those that the factorisation tells of, the reduced unknowns err
/// by `reduced` times these, and the points by `points` times.
struct SharedErrors {
    Eigen::MatrixXd covariance;
    Eigen::MatrixXd reduced;
    Eigen::MatrixXd points;  ///< three rows each
};

/// Holds A, V, W, a, b of the current linearisation; solves them with any damping.
class NormalEquations {
 public:
    NormalEquations(const Model& model, const Layout& layout, int threads = 1);

    const Layout& layout() const { return layout_; }

    // Filled by the objective's linearisation.
    void set_zero();                 ///< all but W, of which each entry is written anyway
    BlockMatrix matrix;              ///< A, lower triangle
    Eigen::VectorXd gradient;        ///< a
    std::vector<Eigen::Matrix3d> V;  ///< of each point
    std::vector<Eigen::Vector3d> b;  ///< of each point
    std::vector<Matrix63d> W;        ///< of each observation: pose by point; zero without a pull
    std::optional<Border> rig;       ///< of unknowns of the rig, where there are any

    /// How points are damped. In bearing and range alike: a relative change of range costs what a
    /// turn of the sight lines by as much does, which keeps points in place while the cameras'
    /// poses are wrong. By what their images tell of each: far points move as freely as near ones.
    enum class PointDamping { alike, as_seen };
    PointDamping point_damping = PointDamping::as_seen;

    /// Takes a scalar unknown out of the problem (all its Jacobians must be zero).
    void hold(int scalar_idx) { matrix.diagonal(scalar_idx) += 1; }

    /// Damped step: solves with lambda diag(H) added (Marquardt), for points as `point_damping`
    /// says. False if not positive definite.
    bool solve(double lambda, Step& step);
    /// What solve() would find, nearly: after a new linearisation, with the factorisation of the
    /// reduced system as it was. Near a minimum a small part of a solution's time foretells it.
    bool resolve(Step& step);
    /// Cost decrease that the linear model promises for a step of the last of these two.
    double predicted_decrease(const Step& step) const;

    /// Factorisation of the reduced system, for covariances. Damped: see solve().
    bool factorize(double lambda = 0);
    const BlockCholesky& factor() const { return factor_; }
    /// Of the rig's unknowns, after factorize(); empty where there are none or they are not
    /// determined.
    const std::optional<SharedErrors>& rig_solution() const { return rig_solution_; }
    /// The unknown of the rig that is determined least, against what it would be were all else
    /// known; after factorize().
    int weakest_rig_unknown() const { return weakest_rig_unknown_; }
    /// The variance of c^T x for the reduced unknowns x becomes `factor` times what it is, and all
    /// covariances what they then are: those of errors that c^T x says nothing of stay. After
    /// factorize().
    void widen(const Eigen::VectorXd& c, double factor);
    /// The rig's, and then those of what was widened.
    const std::optional<SharedErrors>& shared_errors() const { return shared_errors_; }
    /// Covariance of E^T x for the reduced unknowns x, shared errors included.
    Eigen::MatrixXd covariance(const Eigen::MatrixXd& E) const;
    /// V^-1 of an eliminated point.
    Eigen::Matrix3d point_inverse(int point_idx) const {
        return V_root_[point_idx] * V_root_[point_idx].transpose();
    }

 private:
    bool invert_points();
    bool eliminate(double lambda);
    bool complete(Step& step) const;
    Eigen::VectorXd reduced_gradient() const;
    Eigen::MatrixXd reduced_rig() const;
    Eigen::MatrixXd rig_information(const Eigen::MatrixXd& columns,
                                    const Eigen::MatrixXd& solved) const;
    bool solve_rig(Step& step) const;
    void solve_points(Step& step) const;
    void solve_rig_covariance();
    Eigen::MatrixXd moved_points(const Eigen::MatrixXd& reduced, const Eigen::MatrixXd* own) const;
    double damping(double diagonal) const;
    Eigen::Matrix3d point_damping_matrix(int point_idx) const;

    const Model& model_;
    Layout layout_;
    int threads_;
    BlockCholesky factor_;
    std::vector<Eigen::Matrix3d> V_root_;  // Q with V^-1 = Q Q^T
    Eigen::VectorXd damping_;              // of each scalar unknown
    std::optional<SharedErrors> rig_solution_;
    std::optional<SharedErrors> shared_errors_;
    int weakest_rig_unknown_ = 0;
    double lambda_ = 0;
};

}  // namespace vio::batch
