#include "libvio/batch/published_frame.h"

#include <cmath>

namespace vio::batch {

Pose body_pose(const Model& model, const State& state, int frame) {
    const InertialState& I = state.frames[frame].motion;
    return Pose{I.R, I.p} * model.T_I_B;
}

Gauge make_gauge(const Model& model, const State& state) {
    Gauge gauge;
    if (model.surveyed()) return gauge;  // W is the survey's
    const Pose first = body_pose(model, state, 0);
    Eigen::Matrix3d R = first.R.transpose();
    if (model.inertial) {
        const Eigen::Vector3d down(0, 0, -1);
        const Eigen::Matrix3d upright = so3::rotation_between(state.gravity, down);
        const Eigen::Matrix3d R0 = upright * first.R;
        R = so3::exp({0, 0, -std::atan2(R0(1, 0), R0(0, 0))}) * upright;
        gauge.depends_on_gravity = true;
        // Gravity moved by d must again point down: the tilt is z x (R d) / |g|.
        gauge.tilt_by_gravity = so3::skew(Eigen::Vector3d::UnitZ()) * R / state.gravity.norm();
    }
    gauge.T_Wp_W = {R, -(R * first.p)};
    return gauge;
}

Eigen::Matrix3d curvature_of_bias(const Eigen::Matrix3d& covariance, const Eigen::Vector3d& g_I) {
    const Eigen::Vector3d along = g_I.normalized();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - along * along.transpose();
    const Eigen::Matrix3d C = across * covariance * across;
    const double fourth = 2 * (C * C).trace() + C.trace() * C.trace();
    return along * along.transpose() * (fourth / (4 * g_I.squaredNorm()));
}

}  // namespace vio::batch
