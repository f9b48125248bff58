// What the noise of inertial readings seems to tell about scale.
//
// Scale relates the motion that images show to the one that was read, and both are noisy: a
// regression with errors in both variables. Its slope, as the minimum of the cost has it, is right
// (but for less than its own variance), its covariance is not: the information is found at the
// estimated motion, of which some is noise. For changes of velocity x_i that readings tell with
// variance (1 - rho) v and images, but for scale, with rho v, the information is taken for
//   I = sum x^_i^2 / v,  in the mean  sum x_i^2 / v + m,  m = n rho (1 - rho),
// and the variance of the slope is (sum x_i^2 / v + m) / (sum x_i^2 / v)^2 (Fuller, Measurement
// Error Models, 1987, section 1.3). With x = 1 - m / I that is 1 / (x^2 I).
//
// In the batch problem, with J the whitened rows of the readings and P the covariance of all
// unknowns were scale and rig known, rho becomes H = J P J^T. Scaled are positions and velocities;
// with J_s the columns of these alone, the motion is off by noise of covariance J_s P J_s^T, hence
//   m = tr((1 - H) J_s P J_s^T),
// a mean over random signs z (Hutchinson 1990) of ((1 - H) z)^T J_s P J_s^T z.
#pragma once

#include "libvio/batch/normal_equations.h"
#include "libvio/batch/objective.h"

namespace vio::batch {

/// What reads the scale that fits the path best from the reduced unknowns: d(scale) = c^T x = sum
/// p_i . dp_i / sum |p_i|^2, with p_i counted from the first image. Empty where all are in one
/// place.
Eigen::VectorXd scale_reading(const Model& model, const State& state,
                              const NormalEquations& equations);

/// Makes the variance of scale, and with it the covariances that `equations` give, what it is. They
/// must be factorised (undamped) at `state`, with all weights those of noise.
void widen_scale(const Model& model, const Objective& objective, const State& state,
                 NormalEquations& equations);

}  // namespace vio::batch
