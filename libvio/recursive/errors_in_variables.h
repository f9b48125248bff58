// What the noise of inertial readings seems to tell about scale.
//
// Scale relates the acceleration that images show to the one that was read. The filter learns it
// from the sensitivity g of its errors e to the logarithm of scale, which the readings drive: as
// read, with their noise. Images then correct that same noise, so sensitivity and innovation are
// correlated, and every correction pulls scale the same way: as in any regression on a noisy
// variable the slope comes out too small, the motion too large (Fuller, Measurement Error Models,
// 1987). Where the noise exceeds the motion, that is by tens of percent.
//
// The correlation C = E[g~ e^T] of the noise in g with the errors follows the loop of the filter
// itself, here over core and clones (landmarks hold little of that noise). An innovation, residual
// H e + unit noise with covariance S, tells of the noise as of everything else: g~ = C H^T S^-1
// residual, which is taken out of g before the innovation acts on scale. What is then left in g is
// independent of the innovation. (The minimum of the batch's cost does the same: it is a regression
// with errors in both variables.)
#pragma once

#include <Eigen/Dense>

#include "libvio/base/blas.h"
#include "libvio/recursive/carrier.h"
#include "libvio/recursive/core_state.h"

namespace vio {

/// For an inertial core: C above, of core and clones.
class ErrorsInVariables {
 public:
    ErrorsInVariables();

    const Eigen::MatrixXd& correlation() const { return C_; }

    void forget() { C_.setZero(); }
    /// The core moves; P: its covariance before.
    void propagate(const CoreMatrix& transition, const CoreMatrix& noise, const CoreMatrix& P);
    /// The core was measured: its errors become `reduction` times what they were, and noise.
    void update_core(const CoreMatrix& reduction);
    /// Carries what the core did since the last call over to the clones. P: covariance of the core
    /// with the clones at the last call.
    void settle(const Eigen::Ref<const Eigen::MatrixXd>& P);
    /// The core's pose becomes the clone at an offset.
    void clone(int at);
    /// Errors from `at` on become T times what they were.
    void carry(int at, const Carrier& T);
    /// Core and clones were measured: their errors become (I - W X^T) times what they were, and
    /// noise. With S = L L^T: W = P H^T L^-T, X = H^T L^-T.
    void update(const blas::ConstMatrix& W, const blas::ConstMatrix& X);

 private:
    Eigen::MatrixXd C_;
    Eigen::MatrixXd K_, copy_;  // work space
    // What waits for the clones r: C_cr = transition C_cr + coupling P_cr, C_rc = C_rc
    // transition^T.
    CoreMatrix transition_, coupling_;
};

}  // namespace vio
