#include "libvio/simulation/imu_simulator.h"

#include <algorithm>
#include <cmath>

#include "libvio/geometry/so3.h"

namespace vio {
namespace {

ImuReading instantaneous(const Motion& imu, const Eigen::Vector3d& g_W, TimeNs t) {
    return {t, imu.omega_B, imu.T_W_B.R.transpose() * (imu.a_W - g_W)};
}

// Integrates from one reading to the next, with stops at the given times.
InertialState advanced(InertialState state, const ImuReading& from, const ImuReading& to,
                       const std::vector<TimeNs>& ends, const Eigen::Vector3d& g_W) {
    const ImuSequence pair({from, to});
    TimeNs t = from.t;
    for (const TimeNs end : ends) {
        const auto segments = pair.segments(t, end);
        for (const ImuSegment& segment : segments.value()) integrate(state, segment, g_W);
        t = end;
    }
    return state;
}

Eigen::Vector3d limited(const Eigen::Vector3d& x, double limit) {
    if (limit <= 0) return x;
    return x.cwiseMin(limit).cwiseMax(-limit);
}

Eigen::Vector3d quantised(const Eigen::Vector3d& x, double step) {
    if (step <= 0) return x;
    return step * (x / step).array().round().matrix();
}

}  // namespace

std::vector<double> imu_times(double begin, double end, double rate, double jitter,
                              Random& random) {
    constexpr double kTick = 1e-7;
    const double spacing = 1 / rate, limit = 0.4 * spacing;
    std::vector<double> times;
    for (int k = 0;; ++k) {
        const double nominal = begin + (k - 1) * spacing;
        const double displaced =
            nominal + (jitter > 0 ? std::clamp(jitter * random.normal(), -limit, limit) : 0.0);
        times.push_back(std::round(displaced / kTick) * kTick);
        if (times.back() >= end) break;
    }
    return times;
}

std::vector<ImuReading> ideal_imu(const Trajectory& trajectory, const Pose& T_B_I,
                                  const Eigen::Vector3d& g_W, const std::vector<double>& times,
                                  const std::vector<double>& cuts) {
    std::vector<ImuReading> readings;
    if (times.empty()) return readings;
    readings.reserve(times.size());
    const auto motion_at = [&](double t) { return moved_to(trajectory.at(t), T_B_I); };
    const Motion first = motion_at(times.front());
    InertialState integrated{first.T_W_B.R, first.T_W_B.p, first.v_W};
    readings.push_back(instantaneous(first, g_W, from_seconds(times.front())));
    auto cut = cuts.begin();
    for (size_t k = 1; k < times.size(); ++k) {
        const Motion motion = motion_at(times[k]);
        ImuReading reading = instantaneous(motion, g_W, from_seconds(times[k]));
        const ImuReading& previous = readings.back();
        std::vector<TimeNs> ends;
        for (; cut != cuts.end() && from_seconds(*cut) < reading.t; ++cut)
            if (from_seconds(*cut) > previous.t) ends.push_back(from_seconds(*cut));
        ends.push_back(reading.t);
        // A reading weighs half in each of its two intervals: taking off error / dt removes half of
        // the error now and half in the next step, which leaves no oscillation. Velocity aims at
        // closing the position's error over kPullTime.
        constexpr double kPullTime = 1;  // [s]
        const double dt = to_seconds(reading.t - previous.t);
        const Eigen::Matrix3d R_W_I = motion.T_W_B.R;
        reading.gyro -=
            so3::log(R_W_I.transpose() * advanced(integrated, previous, reading, ends, g_W).R) / dt;
        const InertialState reached = advanced(integrated, previous, reading, ends, g_W);
        const Eigen::Vector3d velocity_error =
            reached.v - motion.v_W + (reached.p - motion.T_W_B.p) / kPullTime;
        reading.accel -= R_W_I.transpose() * velocity_error / dt;
        integrated = advanced(integrated, previous, reading, ends, g_W);
        readings.push_back(reading);
    }
    return readings;
}

SimulatedImu with_errors(const std::vector<ImuReading>& ideal, const ImuErrors& errors,
                         Random& random) {
    SimulatedImu result;
    if (ideal.empty()) return result;
    const double duration = to_seconds(ideal.back().t - ideal.front().t);
    const double rate = duration > 0 ? static_cast<double>(ideal.size() - 1) / duration : 0;
    const double gyro_sigma = errors.noise.gyro_noise_density * std::sqrt(rate);
    const double accel_sigma = errors.noise.accel_noise_density * std::sqrt(rate);
    ImuBias bias = errors.initial_bias;
    for (size_t k = 0; k < ideal.size(); ++k) {
        if (k > 0) {
            const double root_dt = std::sqrt(to_seconds(ideal[k].t - ideal[k - 1].t));
            bias.gyro += errors.noise.gyro_bias_random_walk * root_dt * random.normal3();
            bias.accel += errors.noise.accel_bias_random_walk * root_dt * random.normal3();
        }
        const Eigen::Vector3d gyro =
            errors.gyro_gain * ideal[k].gyro + bias.gyro + gyro_sigma * random.normal3();
        const Eigen::Vector3d accel =
            errors.accel_gain * ideal[k].accel + bias.accel + accel_sigma * random.normal3();
        result.readings.push_back(
            {ideal[k].t, quantised(limited(gyro, errors.gyro_limit), errors.gyro_step),
             quantised(limited(accel, errors.accel_limit), errors.accel_step)});
        result.biases.push_back(bias);
    }
    return result;
}

}  // namespace vio
