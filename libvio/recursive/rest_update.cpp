#include "libvio/recursive/rest_update.h"

#include <cmath>

#include "libvio/base/chi_square.h"
#include "libvio/geometry/so3.h"

namespace vio {

using Eigen::Matrix3d;

namespace {

// What a vehicle does that passes for resting, from one image to the next.
constexpr double kVelocity_mps = 5e-3, kMoved_m = 1e-3, kTurned_rad = 5e-4;

}  // namespace

bool update_at_rest(FilterState& state, int earlier_slot, double gate, double hidden_velocity,
                    double interval) {
    const CoreState& core = state.core();
    const Pose& earlier = state.clones()[static_cast<std::size_t>(earlier_slot)].T_W_I;
    const Matrix3d Rt = core.T_W_I.R.transpose(), earlier_Rt = earlier.R.transpose();
    const Matrix3d turned = earlier_Rt * core.T_W_I.R;
    const Eigen::Vector3d moved = earlier_Rt * (core.T_W_I.p - earlier.p), v_I = Rt * core.v_W;
    const int at = state.clone_offset(earlier_slot);
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(9, state.window_size());
    Eigen::VectorXd residual(9);
    H.block<3, 3>(0, kRotation) = so3::skew(v_I);
    H.block<3, 3>(0, kVelocity) = Rt;
    H.block<3, 3>(3, kPosition) = earlier_Rt;
    H.block<3, 3>(3, at + kPosition) = -earlier_Rt;
    H.block<3, 3>(3, at + kRotation) = so3::skew(moved);
    H.block<3, 3>(6, kRotation).setIdentity();  // the angle is small
    H.block<3, 3>(6, at + kRotation) = -turned.transpose();
    residual << -v_I, -moved, -so3::log(turned);
    const double velocity = std::hypot(kVelocity_mps, hidden_velocity),
                 distance = std::hypot(kMoved_m, hidden_velocity * interval);
    const Eigen::Matrix<double, 9, 1> weight =
        (Eigen::Matrix<double, 9, 1>() << Eigen::Vector3d::Constant(1 / velocity),
         Eigen::Vector3d::Constant(1 / distance), Eigen::Vector3d::Constant(1 / kTurned_rad))
            .finished();
    H = (weight.asDiagonal() * H).eval();
    residual = weight.cwiseProduct(residual).eval();
    Eigen::MatrixXd S = state.projected_covariance(H);
    S.diagonal().array() += 1;
    if (residual.dot(S.llt().solve(residual)) > chi_square_quantile(9, gate)) return false;
    state.update(H, residual);
    return true;
}

}  // namespace vio
