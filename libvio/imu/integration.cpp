#include "libvio/imu/integration.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "libvio/base/errors.h"
#include "libvio/geometry/so3.h"

namespace vio {
namespace {

// Of G1 = I + S/divisor[0] + S^2/divisor[1] and G2 = I/2 + S/divisor[1] + S^2/divisor[2]; slope:
// derivatives of the inverse divisors by the angle, over the angle.
struct Coefficients {
    double divisor[3] = {2, 6, 24}, slope[3] = {-1. / 12, -1. / 60, -1. / 360};

    explicit Coefficients(double angle2) {
        constexpr double kSmall = 0.03;  // [rad]: what the divisors above leave out is 1e-6 of a
        if (angle2 < kSmall * kSmall) return;
        const double angle = std::sqrt(angle2), s = std::sin(angle), c = std::cos(angle);
        const double value[] = {(1 - c) / angle2, (angle - s) / (angle2 * angle),
                                (angle2 / 2 - 1 + c) / (angle2 * angle2)};
        for (int i = 0; i < 3; ++i) divisor[i] = 1 / value[i];
        slope[0] = (s / angle - 2 * value[0]) / angle2;
        slope[1] = (value[0] - 3 * value[1]) / angle2;
        slope[2] = (value[1] - 4 * value[2]) / angle2;
    }
};

bool earlier(const ImuReading& reading, TimeNs t) {
    return reading.t < t;
}

}  // namespace

ImuReading interpolated(const ImuReading& a, const ImuReading& b, TimeNs t) {
    if (b.t <= a.t) return {t, a.gyro, a.accel};
    const double s = static_cast<double>(t - a.t) / static_cast<double>(b.t - a.t);
    return {t, a.gyro + s * (b.gyro - a.gyro), a.accel + s * (b.accel - a.accel)};
}

void integrate(InertialState& state, const ImuSegment& unbiased, const Eigen::Vector3d& g_W,
               IntegrationJacobian* jacobian) {
    const double dt = unbiased.dt;
    const Eigen::Vector3d phi = unbiased.gyro * dt;
    const Eigen::Vector3d& a = unbiased.accel;
    const Eigen::Vector3d phi_a = phi.cross(a), phi_phi_a = phi.cross(phi_a);
    const Coefficients c(phi.squaredNorm());
    const Eigen::Vector3d a1 = a + phi_a / c.divisor[0] + phi_phi_a / c.divisor[1];
    const Eigen::Vector3d a2 = a / 2 + phi_a / c.divisor[1] + phi_phi_a / c.divisor[2];
    const Eigen::Matrix3d dR = so3::exp(phi);

    if (jacobian) {
        const Eigen::Matrix3d S = so3::skew(phi), S2 = S * S, A = so3::skew(a);
        // d (phi x a) / d phi = -A;  d (phi x (phi x a)) / d phi = -skew(phi x a) - S A.
        const Eigen::Matrix3d dA = -A, dSA = -so3::skew(phi_a) - S * A;
        const Eigen::Matrix3d& R = state.R;
        Matrix9d& F = jacobian->F;
        F.setIdentity();
        F.block<3, 3>(0, 0) = dR.transpose();
        F.block<3, 3>(3, 0) = -R * so3::skew(a2) * (dt * dt);
        F.block<3, 3>(3, 6).diagonal().setConstant(dt);
        F.block<3, 3>(6, 0) = -R * so3::skew(a1) * dt;
        const auto derivative = [&](int i) -> Eigen::Matrix3d {  // of phi x a / d_i + ...
            return dA / c.divisor[i] + dSA / c.divisor[i + 1] +
                   (c.slope[i] * phi_a + c.slope[i + 1] * phi_phi_a) * phi.transpose();
        };
        jacobian->G_gyro << so3::right_jacobian(phi) * dt, R * derivative(1) * (dt * dt * dt),
            R * derivative(0) * (dt * dt);
        const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
        jacobian->G_accel << Eigen::Matrix3d::Zero(),
            R * (I / 2 + S / c.divisor[1] + S2 / c.divisor[2]) * (dt * dt),
            R * (I + S / c.divisor[0] + S2 / c.divisor[1]) * dt;
    }

    state.p += state.v * dt + g_W * (dt * dt / 2) + state.R * a2 * (dt * dt);
    state.v += g_W * dt + state.R * a1 * dt;
    state.R = so3::normalized(state.R * dR);
}

Matrix9d white_noise(const IntegrationJacobian& jacobian, double gyro_density2,
                     double accel_density2, double dt) {
    Matrix9d covariance;
    covariance.noalias() = (gyro_density2 / dt) * jacobian.G_gyro * jacobian.G_gyro.transpose();
    covariance.noalias() += (accel_density2 / dt) * jacobian.G_accel * jacobian.G_accel.transpose();
    covariance.diagonal().segment<3>(3).array() += accel_density2 * dt * dt * dt / 12;
    return covariance;
}

ImuSequence::ImuSequence(std::vector<ImuReading> readings) {
    readings_.reserve(readings.size());
    for (const ImuReading& reading : readings) push_back(reading);
}

void ImuSequence::push_back(const ImuReading& reading) {
    if (!readings_.empty() && reading.t <= readings_.back().t)
        throw InputError("IMU stream (t = " + std::to_string(reading.t) +
                         " ns): time does not increase; sort the recording or remove duplicates");
    readings_.push_back(reading);
}

void ImuSequence::drop_before(TimeNs t) {
    auto first = std::lower_bound(readings_.begin(), readings_.end(), t, earlier);
    if (first == readings_.end() || first->t > t) {
        if (first == readings_.begin()) return;
        --first;
    }
    readings_.erase(readings_.begin(), first);
}

bool ImuSequence::covers(TimeNs begin, TimeNs end) const {
    return !readings_.empty() && readings_.front().t <= begin && end <= readings_.back().t;
}

std::optional<ImuReading> ImuSequence::interpolate(TimeNs t) const {
    if (!covers(t, t)) return std::nullopt;
    const auto after = std::lower_bound(readings_.begin(), readings_.end(), t, earlier);
    if (after->t == t) return *after;
    return interpolated(*(after - 1), *after, t);
}

std::optional<std::vector<ImuSegment>> ImuSequence::segments(TimeNs begin, TimeNs end) const {
    if (begin > end || !covers(begin, end)) return std::nullopt;
    std::vector<ImuSegment> result;
    ImuReading from = *interpolate(begin);
    auto next = std::upper_bound(readings_.begin(), readings_.end(), begin,
                                 [](TimeNs t, const ImuReading& r) { return t < r.t; });
    while (from.t < end) {
        const ImuReading to = next->t <= end ? *next : interpolated(*(next - 1), *next, end);
        result.push_back(
            {to_seconds(to.t - from.t), (from.gyro + to.gyro) / 2, (from.accel + to.accel) / 2});
        from = to;
        ++next;
    }
    return result;
}

double ImuSequence::largest_gap(TimeNs begin, TimeNs end) const {
    double gap = 0;
    auto it = std::upper_bound(readings_.begin(), readings_.end(), begin,
                               [](TimeNs t, const ImuReading& r) { return t < r.t; });
    if (it == readings_.begin() && it != readings_.end()) ++it;
    for (; it != readings_.end() && (it - 1)->t < end; ++it)
        gap = std::max(gap, to_seconds(it->t - (it - 1)->t));
    return gap;
}

}  // namespace vio
