#include "libvio/calibration/allan_deviation.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "libvio/base/errors.h"
#include "libvio/calibration/still_stretch.h"

namespace vio {
namespace {

constexpr double kFlicker = 2 * std::numbers::ln2 / std::numbers::pi;
constexpr size_t kLeastPairs = 4;
// 1 % point of chi-square with one degree of freedom.
constexpr double kSignificant = 6.63;

enum Term { kWhite, kBias, kWalk };

// Share of each term's squared coefficient in the variance at tau; flicker as a variance.
Eigen::Vector3d shares(double tau) {
    return {1 / tau, 1, tau / 3};
}

struct Solution {
    Eigen::Vector3d theta = Eigen::Vector3d::Zero();  // N^2, (2 ln 2 / pi) B^2, K^2
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    double minus_log_likelihood = 0;
};

double variance_at(const Eigen::Vector3d& theta, double tau) {
    return shares(tau).dot(theta);
}

double minus_log_likelihood(const std::vector<AllanLevel>& levels, const Eigen::Vector3d& theta) {
    double sum = 0;
    for (const AllanLevel& level : levels) {
        const double variance = variance_at(theta, level.tau);
        sum += 0.5 * level.pairs * (std::log(variance) + level.variance / variance);
    }
    return sum;
}

// Normal equations of the levels, weighted by the variances that theta predicts: one step of Fisher
// scoring, since the variance is linear in theta.
void normal_equations(const std::vector<AllanLevel>& levels, const Eigen::Vector3d& theta,
                      Eigen::Matrix3d& A, Eigen::Vector3d& b) {
    A.setZero();
    b.setZero();
    for (const AllanLevel& level : levels) {
        const Eigen::Vector3d share = shares(level.tau);
        const double variance = variance_at(theta, level.tau);
        const double weight = 0.5 * level.pairs / (variance * variance);
        A += weight * share * share.transpose();
        b += weight * level.variance * share;
    }
}

// Inverse of the rows and columns of A that are in use, elsewhere zero.
Eigen::Matrix3d inverse_of(const Eigen::Matrix3d& A, const std::array<bool, 3>& in_use) {
    // Rows are scaled to one: the terms differ by many orders of magnitude.
    const Eigen::Vector3d scale = A.diagonal().cwiseSqrt().cwiseInverse();
    Eigen::Matrix3d scaled = scale.asDiagonal() * A * scale.asDiagonal();
    for (int i = 0; i < 3; ++i)
        if (!in_use[static_cast<size_t>(i)]) {
            scaled.row(i).setZero();
            scaled.col(i).setZero();
            scaled(i, i) = 1;
        }
    Eigen::Matrix3d inverse = scale.asDiagonal() * scaled.inverse().eval() * scale.asDiagonal();
    for (int i = 0; i < 3; ++i)
        if (!in_use[static_cast<size_t>(i)]) {
            inverse.row(i).setZero();
            inverse.col(i).setZero();
        }
    return inverse;
}

// Maximum likelihood with coefficients that are not negative. The covariance is that of all terms
// allowed, so that it tells about one at zero, too.
Solution solve(const std::vector<AllanLevel>& levels, const std::array<bool, 3>& allowed) {
    Solution s;
    s.theta(kWhite) = levels.front().variance * levels.front().tau;
    Eigen::Matrix3d A;
    Eigen::Vector3d b;
    for (int iteration = 0; iteration < 100; ++iteration) {
        normal_equations(levels, s.theta, A, b);
        std::array<bool, 3> in_use = allowed;
        Eigen::Vector3d next = inverse_of(A, in_use) * b;
        for (const int term : {kBias, kWalk}) {
            if (next(term) >= 0) continue;
            in_use[static_cast<size_t>(term)] = false;
            next = inverse_of(A, in_use) * b;
        }
        next = next.cwiseMax(0);
        const double change =
            (next - s.theta).cwiseAbs().cwiseQuotient((next + s.theta).cwiseMax(1e-300)).maxCoeff();
        s.theta = next;
        if (change < 1e-10) break;
    }
    normal_equations(levels, s.theta, A, b);
    s.covariance = inverse_of(A, allowed);
    s.minus_log_likelihood = minus_log_likelihood(levels, s.theta);
    return s;
}

// Of a coefficient, given its square with variance; factor: square over coefficient squared.
Estimated root(double square, double square_variance, double factor) {
    const double sigma = std::sqrt(square_variance) / factor;
    const double value2 = square / factor;
    Estimated e;
    e.value = std::sqrt(value2);
    e.determined = value2 > 2 * sigma;
    e.sigma = value2 > 0 ? sigma / (2 * e.value) : std::sqrt(sigma);
    e.bound = std::sqrt(value2 + 1.645 * sigma);
    return e;
}

double chi2_per_level(const std::vector<AllanLevel>& levels, const Eigen::Vector3d& theta,
                      double parameters) {
    double sum = 0;
    for (const AllanLevel& level : levels) {
        const double ratio = level.variance / variance_at(theta, level.tau) - 1;
        sum += 0.5 * level.pairs * ratio * ratio;
    }
    return sum / (static_cast<double>(levels.size()) - parameters);
}

// Mean variance of the three axes, with the degrees of freedom of all.
std::vector<AllanLevel> together(const std::array<std::vector<AllanLevel>, 3>& axes) {
    std::vector<AllanLevel> all = axes[0];
    for (size_t i = 0; i < all.size(); ++i) {
        all[i].variance = (axes[0][i].variance + axes[1][i].variance + axes[2][i].variance) / 3;
        all[i].pairs = 3 * axes[0][i].pairs;
    }
    return all;
}

template <typename Read>
ImuNoiseEstimate::Sensor analyse(const std::vector<ImuReading>& readings, double interval,
                                 const Read& read) {
    ImuNoiseEstimate::Sensor sensor;
    std::array<std::vector<AllanLevel>, 3> levels;
    std::vector<double> values(readings.size());
    for (int axis = 0; axis < 3; ++axis) {
        // Without the mean, which in single sums of millions would cost digits.
        const double offset = read(readings.front())(axis);
        for (size_t i = 0; i < readings.size(); ++i) values[i] = read(readings[i])(axis) - offset;
        const auto at = static_cast<size_t>(axis);
        levels[at] = allan_levels(values, interval);
        if (!(levels[at].back().variance > 0) || !(levels[at].front().variance > 0))
            throw InputError("the readings of an axis do not change at all; is the sensor alive?");
        sensor.axes[at] = fit_allan(levels[at]);
    }
    sensor.levels = together(levels);
    sensor.all = fit_allan(sensor.levels);
    return sensor;
}

void warn(const ImuNoiseEstimate::Sensor& sensor, const std::string& name, double duration,
          std::vector<std::string>& warnings) {
    const AllanFit& fit = sensor.all;
    if (!fit.random_walk.determined && !fit.bias_instability.determined)
        warnings.push_back(name + ": " + std::to_string(std::lround(duration)) +
                           " s are too short to tell the drift of the bias; the upper bound of its "
                           "random walk is taken. Hours at rest tell it");
    if (fit.misfit > 5)
        warnings.push_back(name +
                           ": the readings have noise of another kind than white, flicker and "
                           "random walk (vibration, temperature, coarse steps); values are rough");
}

}  // namespace

std::vector<AllanLevel> allan_levels(const std::vector<double>& readings, double interval) {
    std::vector<AllanLevel> levels;
    std::vector<double> means = readings;
    for (double tau = interval; means.size() / 2 >= kLeastPairs; tau *= 2) {
        const size_t pairs = means.size() / 2;
        double sum = 0;
        for (size_t i = 0; i < pairs; ++i) {
            const double difference = means[2 * i + 1] - means[2 * i];
            sum += difference * difference;
            means[i] = 0.5 * (means[2 * i] + means[2 * i + 1]);
        }
        means.resize(pairs);
        const auto n = static_cast<double>(pairs);
        levels.push_back({tau, 0.5 * sum / n, n});
    }
    return levels;
}

AllanFit fit_allan(const std::vector<AllanLevel>& all_levels, double min_tau) {
    std::vector<AllanLevel> levels;
    for (const AllanLevel& level : all_levels)
        if (level.tau >= min_tau) levels.push_back(level);
    if (levels.size() < 4)
        throw InputError("too few readings for an Allan variance; record for a minute at least");
    Solution s = solve(levels, {true, false, true});
    const Solution with_flicker = solve(levels, {true, true, true});
    const bool flicker =
        2 * (s.minus_log_likelihood - with_flicker.minus_log_likelihood) > kSignificant;
    if (flicker) s = with_flicker;
    AllanFit fit;
    fit.noise_density = root(s.theta(kWhite), s.covariance(kWhite, kWhite), 1);
    fit.bias_instability = root(s.theta(kBias), s.covariance(kBias, kBias), kFlicker);
    fit.random_walk = root(s.theta(kWalk), s.covariance(kWalk, kWalk), 1);
    fit.misfit = chi2_per_level(levels, s.theta, flicker ? 3 : 2);
    return fit;
}

double covering_random_walk(const AllanFit& fit) {
    if (!fit.random_walk.determined && !fit.bias_instability.determined)
        return fit.random_walk.bound;
    const double flicker = kFlicker * fit.bias_instability.value * fit.bias_instability.value;
    return std::hypot(fit.random_walk.value,
                      std::numbers::sqrt3 * flicker / fit.noise_density.value);
}

ImuNoiseEstimate estimate_imu_noise(const std::vector<ImuReading>& readings) {
    const StillStretch still = longest_still_stretch(readings);
    const std::vector<ImuReading> used(readings.begin() + still.begin,
                                       readings.begin() + still.end);
    ImuNoiseEstimate e;
    e.warnings = still.warnings;
    e.first = used.front().t;
    e.last = used.back().t;
    const double duration = to_seconds(e.last - e.first);
    const double interval = duration / static_cast<double>(used.size() - 1);
    e.rate = 1 / interval;
    e.gyro = analyse(used, interval, [](const ImuReading& r) { return r.gyro; });
    e.accel = analyse(used, interval, [](const ImuReading& r) { return r.accel; });
    warn(e.gyro, "gyro", duration, e.warnings);
    warn(e.accel, "accelerometer", duration, e.warnings);
    e.noise.gyro_noise_density = e.gyro.all.noise_density.value;
    e.noise.accel_noise_density = e.accel.all.noise_density.value;
    e.noise.gyro_bias_random_walk = covering_random_walk(e.gyro.all);
    e.noise.accel_bias_random_walk = covering_random_walk(e.accel.all);
    return e;
}

}  // namespace vio
