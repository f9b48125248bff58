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
// itself, over core, clones and landmarks: points are placed with the noise of the baselines that
// they come from, so what core and landmarks share of it does not show. An innovation, residual
// H e + unit noise with covariance S, tells of the noise as of everything else: g~ = C H^T S^-1
// residual, which is taken out of g before the innovation acts on scale. What is then left in g is
// independent of the innovation. (The minimum of the batch's cost does the same: it is a regression
// with errors in both variables.)
//
// The noise that is left, of covariance V = E[g~ g~^T], still passes for information: an innovation
// seems to tell I = (H g)^T S0^-1 H g of scale (S0: its covariance were scale known), though of
// that n = tr(S0^-1 H V H^T) is noise. With the share x = 1 - n / I, of the correction of scale
// that the gain s^2 / (1 + s^2 I) makes for its variance s^2, the best is
//   x (1 + s^2 I) / (1 + s^2 x^2 I),  and leaves the variance  s^2 / (1 + s^2 x^2 I):
// the gain times a score of mean x I and variance I. As I depends on what is moved between two
// images, and its own randomness must not choose among corrections, n and I are means over updates.
// n, which costs most, is found at every few updates and taken for the same until the next.
// All of it is of first order: after a correction too large for that n comes out negative, and C
// and V begin anew.
//
// Images see no multiple of n_s, what scale makes of the state, so how much of it is in g~ is but a
// choice of what reads scale, and would grow without bound where points are soon replaced. Read by
// s, the landmarks' mean, it is none: whatever moves landmarks, g~ becomes g~ - n_s (s^T g~).
//
// V is that of core, mount and clones, as if landmarks held no noise beside that mean.
// With many landmarks C would cost several times what the filter does; then it is that of core and
// clones alone, too, as if landmarks held none of the noise, and n is not known.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "libvio/base/blas.h"
#include "libvio/recursive/anchored_point.h"
#include "libvio/recursive/carrier.h"
#include "libvio/recursive/core_state.h"

namespace vio {

/// For an inertial core: C and V above, in the order of the filter's errors.
class ErrorsInVariables {
 public:
    /// Scale among all errors: n_s above, and s, of landmarks alone, s^T n_s = 1. Empty where there
    /// are no landmarks to read it.
    struct Scale {
        Eigen::VectorXd direction, reading;
    };

    ErrorsInVariables();

    const Eigen::MatrixXd& correlation() const { return C_; }
    int size() const { return static_cast<int>(C_.rows()); }
    /// Whether C is that of landmarks, too.
    bool has_landmarks() const { return C_.rows() > V_.rows(); }
    /// V, where C is that of landmarks.
    const Eigen::MatrixXd& noise() const { return V_; }

    void forget();
    /// The core moves; P: its covariance before.
    void propagate(const CoreMatrix& transition, const CoreMatrix& noise, const CoreMatrix& P);
    /// The core was measured: its errors become `reduction` times what they were, and noise.
    void update_core(const CoreMatrix& reduction);
    /// Carries what the core did since the last call over to the other errors. P: covariance of
    /// these with the core at the last call.
    void settle(const blas::ConstMatrix& P);
    /// The core's pose becomes the clone at an offset; inserted: the clone is new.
    void clone(int at, bool inserted);
    /// Adds to core and mount errors that the readings' noise has no part in.
    void add_exact(int count);
    /// Adds landmarks' errors, which are G times those from `first` on, and noise.
    void augment(int first, const Eigen::MatrixXd& G);
    /// Then s reads them, too.
    void read_scale_anew(int first, const Eigen::MatrixXd& G, const Scale& scale);
    /// The six errors at `at` grow by `rate` times that at `by`.
    void add(int at, int by, const Vector6d& rate);
    /// The three errors at `at` become J times what they, the poses at two offsets, and the
    /// `mounted` first errors of the mount, were.
    void reanchor(int at, int from, int to, int mount, int mounted, const MovedPoint& J);
    /// Keeps these errors alone, or the first.
    void choose(const std::vector<int>& errors);
    void truncate(int size) { C_.conservativeResize(size, size); }
    /// Errors from `at` on become T times what they were.
    void carry(int at, const Carrier& T);
    /// Gives M H^T.
    using TimesHt = std::function<Eigen::MatrixXd(const blas::ConstMatrix& M)>;
    /// Errors were measured, residual H e + unit noise, of covariance L L^T: what it tells of the
    /// noise is taken out of V.
    void take_out(const TimesHt& times_Ht, const blas::ConstMatrix& L);
    /// Then the errors become (I - gain H) times what they were, and noise.
    void update(const blas::ConstMatrix& gain, const TimesHt& times_Ht, const Scale& scale);
    /// Whether n of the next update is wanted.
    bool noise_due() const { return updates_ % kNoiseEvery == 0; }
    /// x above, after an update of which I is given, and n if it was due.
    double share_of_motion(double information, std::optional<double> noise);

 private:
    Eigen::MatrixXd C_, V_;
    static constexpr int kNoiseEvery = 4;
    double information_ = 0, noise_ = 0;  // means over the last updates
    double latest_noise_ = 0;
    std::int64_t updates_ = 0;  // with a share of motion
    // What waits for the other errors r: C_cr = transition C_cr + coupling P_cr, C_rc = C_rc
    // transition^T.
    CoreMatrix transition_, coupling_;
};

}  // namespace vio
