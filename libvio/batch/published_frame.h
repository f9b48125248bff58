// The frame that estimates are published in, and what errors of its tilt do beyond first order.
#pragma once

#include "libvio/batch/model.h"
#include "libvio/geometry/so3.h"

namespace vio::batch {

/// The solver's world frame W (first pose) seen from the published one W' (z up, first body pose at
/// the origin without yaw): p_W' = R p_W + p. Its tilt depends on the estimated gravity.
struct Gauge {
    Pose T_Wp_W;
    bool depends_on_gravity = false;
    Eigen::Matrix3d tilt_by_gravity = Eigen::Matrix3d::Zero();  ///< d(tilt, in W') / d g_W
};

/// T_W_B in the solver's frame.
Pose body_pose(const Model& model, const State& state, int frame);
Gauge make_gauge(const Model& model, const State& state);

/// What the first order leaves out of an accelerometer bias's covariance. Without rotation only
/// bias + gravity is measured, and gravity's norm is known: the bias lies on a sphere around what
/// is measured, and erring by d across gravity means erring by |d|^2 / (2 |g|) along it. (2 tr(C^2)
/// + tr(C)^2 is the mean of |d|^4 for d of covariance C.) `g_I`: gravity in the IMU's frame.
Eigen::Matrix3d curvature_of_bias(const Eigen::Matrix3d& covariance, const Eigen::Vector3d& g_I);

/// What the first order leaves out of vectors that turn with the published frame: where gravity's
/// direction is known to a degree only, and their length to a tenth, what they are off along
/// themselves turns across by more than their direction is known to. Errors y of the vectors (three
/// rows each), counted half way through the tilt d, add d x y; of this, the second moment by those
/// of d and y (Isserlis): sum over axes a, c of K_a (D_ac Y + x_c x_a^T) K_c^T, and of the mean sum
/// K_a x_a, with K_a y = e_a x y and x_a the covariance of y with d_a.
template <int N>
class Turning {
    using Square = Eigen::Matrix<double, N, N>;
    using Columns = Eigen::Matrix<double, N, 3>;

 public:
    /// Of vectors v with d(their errors) / d(x) = J, x of covariance S with gravity's errors from
    /// `gravity` on.
    template <typename Jacobian, typename Covariance>
    Turning(const Gauge& gauge, const Eigen::Matrix<double, N, 1>& v, const Jacobian& J,
            const Covariance& S, int gravity) {
        const Eigen::Matrix3d& tilt = gauge.tilt_by_gravity;
        auto half = J.eval();
        for (Eigen::Index k = 0; k < v.size(); k += 3)
            half.template block<3, 3>(k, gravity) +=
                so3::skew(Eigen::Vector3d(v.template segment<3>(k))) * tilt / 2;
        D_ = tilt * S.template block<3, 3>(gravity, gravity) * tilt.transpose();
        X_ = half * S.template middleCols<3>(gravity) * tilt.transpose();
        Y_ = half * S * half.transpose();
    }

    Square second_moment() const {
        Square sum = Square::Zero(Y_.rows(), Y_.rows());
        Eigen::Matrix<double, N, 1> mean = Eigen::Matrix<double, N, 1>::Zero(Y_.rows());
        for (int a = 0; a < 3; ++a) {
            mean += turned(a, X_.col(a).eval());
            for (int c = 0; c < 3; ++c) {
                const Square M = D_(a, c) * Y_ + X_.col(c) * X_.col(a).transpose();
                sum += turned(a, turned(c, M.transpose().eval()).transpose().eval());
            }
        }
        return sum + mean * mean.transpose();
    }

 private:
    template <typename Matrix>
    static Matrix turned(int axis, Matrix M) {
        const Eigen::Matrix3d K = so3::skew(Eigen::Vector3d::Unit(axis));
        for (Eigen::Index k = 0; k < M.rows(); k += 3)
            M.template middleRows<3>(k) = (K * M.template middleRows<3>(k)).eval();
        return M;
    }

    Eigen::Matrix3d D_;
    Columns X_;  // covariance of the errors with the tilt
    Square Y_;   // and of these
};

}  // namespace vio::batch
