#include "libvio/imu/integration.h"

#include <algorithm>
#include <string>

#include "libvio/base/errors.h"
#include "libvio/geometry/so3.h"

namespace vio {
namespace {

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
    const Eigen::Vector3d a1 = a + phi_a / 2 + phi_phi_a / 6;
    const Eigen::Vector3d a2 = a / 2 + phi_a / 6 + phi_phi_a / 24;
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
        jacobian->G_gyro << so3::right_jacobian(phi) * dt, R * (dA / 6 + dSA / 24) * (dt * dt * dt),
            R * (dA / 2 + dSA / 6) * (dt * dt);
        const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
        jacobian->G_accel << Eigen::Matrix3d::Zero(), R * (I / 2 + S / 6 + S2 / 24) * (dt * dt),
            R * (I + S / 2 + S2 / 6) * dt;
    }

    state.p += state.v * dt + g_W * (dt * dt / 2) + state.R * a2 * (dt * dt);
    state.v += g_W * dt + state.R * a1 * dt;
    state.R = so3::normalized(state.R * dR);
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
