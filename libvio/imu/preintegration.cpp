#include "libvio/imu/preintegration.h"

#include "libvio/geometry/so3.h"

namespace vio {

PreintegratedImu::PreintegratedImu(const std::vector<ImuSegment>& segments, const ImuBias& bias,
                                   const ImuNoise& noise)
    : bias_(bias) {
    const double accel_density2 = noise.accel_noise_density * noise.accel_noise_density;
    const Eigen::Vector3d no_gravity = Eigen::Vector3d::Zero();
    IntegrationJacobian J;
    for (const ImuSegment& segment : segments) {
        if (!(segment.dt > 0)) continue;
        const ImuSegment unbiased{segment.dt, segment.gyro - bias.gyro, segment.accel - bias.accel};
        integrate(delta_, unbiased, no_gravity, &J);
        d_bias_ = (J.F * d_bias_).eval();
        d_bias_.leftCols<3>() -= J.G_gyro;
        d_bias_.rightCols<3>() -= J.G_accel;
        covariance_ = (J.F * covariance_ * J.F.transpose()).eval();
        covariance_ +=
            white_noise(J, noise.gyro_density2(unbiased.gyro.norm()), accel_density2, segment.dt);
        duration_ += segment.dt;
    }
}

InertialState PreintegratedImu::corrected(const ImuBias& bias) const {
    Vector6d db;
    db << bias.gyro - bias_.gyro, bias.accel - bias_.accel;
    const Vector9d d = d_bias_ * db;
    return {delta_.R * so3::exp(d.head<3>()), delta_.p + d.segment<3>(3), delta_.v + d.tail<3>()};
}

InertialState PreintegratedImu::predict(const InertialState& i, const ImuBias& bias,
                                        const Eigen::Vector3d& g_W) const {
    const double T = duration_;
    const InertialState delta = corrected(bias);
    return {so3::normalized(i.R * delta.R), i.p + i.v * T + g_W * (T * T / 2) + i.R * delta.p,
            i.v + g_W * T + i.R * delta.v};
}

Vector9d PreintegratedImu::residual(const InertialState& i, const InertialState& j,
                                    const ImuBias& bias, const Eigen::Vector3d& g_W,
                                    Jacobian* J) const {
    const double T = duration_;
    const InertialState delta = corrected(bias);
    const Eigen::Matrix3d Rit = i.R.transpose();
    const Eigen::Vector3d rotation = so3::log(delta.R.transpose() * Rit * j.R);
    const Eigen::Vector3d dp = Rit * (j.p - i.p - i.v * T - g_W * (T * T / 2));
    const Eigen::Vector3d dv = Rit * (j.v - i.v - g_W * T);
    Vector9d r;
    r << rotation, dp - delta.p, dv - delta.v;
    if (!J) return r;

    const Eigen::Matrix3d Jri = so3::right_jacobian_inverse(rotation);
    J->state_i.setZero();
    J->state_i.block<3, 3>(0, 0) = -Jri * j.R.transpose() * i.R;
    J->state_i.block<3, 3>(3, 0) = so3::skew(dp);
    J->state_i.block<3, 3>(3, 3) = -Rit;
    J->state_i.block<3, 3>(3, 6) = -Rit * T;
    J->state_i.block<3, 3>(6, 0) = so3::skew(dv);
    J->state_i.block<3, 3>(6, 6) = -Rit;
    J->state_j.setZero();
    J->state_j.block<3, 3>(0, 0) = Jri;
    J->state_j.block<3, 3>(3, 3) = Rit;
    J->state_j.block<3, 3>(6, 6) = Rit;
    // Dr = Dr0 exp(d): r = log(exp(-d) ...), whose derivative wrt d is -Jr^-1(r) exp(-r) Jr(d).
    Vector6d db;
    db << bias.gyro - bias_.gyro, bias.accel - bias_.accel;
    const Eigen::Vector3d d = d_bias_.topRows<3>() * db;
    J->bias.topRows<3>() =
        -Jri * so3::exp(-rotation) * so3::right_jacobian(d) * d_bias_.topRows<3>();
    J->bias.bottomRows<6>() = -d_bias_.bottomRows<6>();
    J->gravity << Eigen::Matrix3d::Zero(), -Rit * (T * T / 2), -Rit * T;
    return r;
}

}  // namespace vio
