#include "libvio/check/inertial.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "libvio/base/angles.h"
#include "libvio/base/median.h"
#include "libvio/check/axes.h"
#include "libvio/geometry/so3.h"
#include "libvio/imu/stillness.h"

namespace vio {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

constexpr double kSpan = 0.1;   // [s] of a mean
constexpr int kTurnSpans = 30;  // of a stretch in which gravity is followed
constexpr TimeNs kRestStretch = 1'000'000'000;
constexpr double kTiltWanted = 0.09;  // [rad] rms
constexpr double kMostLeft = 0.5;  // of the tilt's square, by the gyro, where gravity is to be seen
constexpr double kGravity = 9.80665;                      // [m/s^2]
constexpr double kGravityNear = 0.25, kGravityFar = 0.8;  // [m/s^2] from it
constexpr double kMostBias = 0.2, kFarTooMuchBias = 0.5;  // [rad/s]
constexpr int kClippedRun = 3;                            // readings at the very same extreme value
constexpr double kMostClipped = 0.001;
constexpr double kFrozen = 0.05;  // [s]

std::vector<Vector3d> turned_back(const ReadingMean* begin, int count, double unit,
                                  const Matrix3d& axes) {
    std::vector<Vector3d> forces;
    Matrix3d R = Matrix3d::Identity();
    for (int i = 0; i < count; ++i) {
        if (i > 0) {
            const double dt = begin[i].t - begin[i - 1].t;
            R = R * so3::exp(unit * dt * 0.5 * (begin[i].gyro + begin[i - 1].gyro));
        }
        forces.push_back(R * axes * begin[i].accel);
    }
    return forces;
}

// Sum of the squared deviations from the mean, and of the squares.
std::pair<double, double> spread_of(const std::vector<Vector3d>& values) {
    Vector3d sum = Vector3d::Zero();
    double squares = 0;
    for (const Vector3d& v : values) {
        sum += v;
        squares += v.squaredNorm();
    }
    return {squares - sum.squaredNorm() / static_cast<double>(values.size()), squares};
}

// Calls work(first mean, how many) for stretches without a hole.
template <typename Work>
void for_stretches(const std::vector<ReadingMean>& means, int length, int step, Work work) {
    const int count = static_cast<int>(means.size());
    for (int i = 0; i + length <= count; i += step)
        if (means[i + length - 1].t - means[i].t < 1.5 * kSpan * (length - 1))
            work(means.data() + i, length);
}

double spread_with(const std::vector<ReadingMean>& means, double unit, const Matrix3d& axes) {
    double deviations = 0, squares = 0;
    for_stretches(means, kTurnSpans, kTurnSpans, [&](const ReadingMean* begin, int count) {
        const auto [deviation, square] = spread_of(turned_back(begin, count, unit, axes));
        deviations += deviation;
        squares += square;
    });
    return squares > 0 ? deviations / squares : 0;
}

// Length of the mean specific force of stretches, over which accelerations cancel; nothing where
// there is none. Means are taken as recorded and turned back by the gyro, which is not to be
// trusted yet: where it is wrong, directions scatter, and the mean gets shorter.
std::optional<double> gravity_in_motion(const std::vector<ReadingMean>& means) {
    std::vector<double> lengths;
    for_stretches(means, kTurnSpans, kTurnSpans / 2, [&](const ReadingMean* begin, int count) {
        double longest = 0;
        for (const double unit : {0.0, 1.0}) {
            Vector3d sum = Vector3d::Zero();
            for (const Vector3d& f : turned_back(begin, count, unit, Matrix3d::Identity()))
                sum += f;
            longest = std::max(longest, sum.norm() / count);
        }
        lengths.push_back(longest);
    });
    if (lengths.empty()) return std::nullopt;
    return median(lengths);
}

Finding check_gravity(const Rest& rest, const std::vector<ReadingMean>& means) {
    const bool at_rest = rest.seconds > 0;
    const std::optional<double> moving = at_rest ? std::nullopt : gravity_in_motion(means);
    if (!at_rest && !moving)
        return {Grade::untested, "gravity", "not at rest, and too short to average motion out",
                formatted("at least %g s", kSpan * kTurnSpans), ""};
    const double g = at_rest ? rest.gravity : *moving;
    const double near = at_rest ? kGravityNear : 2 * kGravityNear;
    Finding f{Grade::ok, "gravity",
              at_rest ? formatted("%.3f m/s^2 in %.1f s at rest", g, rest.seconds)
                      : formatted("%.3f m/s^2 on average; never at rest", g),
              formatted("%.2f +- %.2g m/s^2", kGravity, near), ""};
    const double off = std::abs(g - kGravity);
    if (off < near) return f;
    f.grade = off < (at_rest ? 1 : 2) * kGravityFar ? Grade::warning : Grade::error;
    f.advice = "the accelerometer's bias or scale is off; calibrate it";
    const auto is = [&](double value) { return std::abs(g / value - 1) < 0.15; };
    if (is(1)) f.advice = "the accelerometer is in g: multiply it by 9.80665";
    if (is(1000)) f.advice = "the accelerometer is in mg: multiply it by 0.00980665";
    if (is(32.174)) f.advice = "the accelerometer is in ft/s^2: multiply it by 0.3048";
    if (g < 0.5)
        f.advice =
            "gravity has been taken out; record the specific force (phones: accelerometer, "
            "not linear acceleration)";
    return f;
}

Finding check_gyro_at_rest(const Rest& rest) {
    Finding f{Grade::untested, "gyro at rest", "never at rest",
              formatted("at most %g rad/s", kMostBias), ""};
    if (rest.seconds == 0) return f;
    const double bias = rest.gyro.norm();
    f.grade = Grade::ok;
    f.measured = formatted("%.4f rad/s", bias);
    if (bias > kMostBias) {
        f.grade = bias > kFarTooMuchBias ? Grade::error : Grade::warning;
        f.advice = "a large bias, or rates in deg/s, or a slow even turn";
    }
    return f;
}

Finding check_turn(const std::vector<ReadingMean>& means) {
    const GravityTurn turn = gravity_turn(means);
    Finding f{Grade::ok, "gravity's turn",
              formatted("%.1f deg of tilt; gyro leaves %.2f %% of it", turn.tilt / kDegree,
                        turn.tilt > 0 ? 1e2 * turn.spread / (turn.tilt * turn.tilt) : 0),
              "accelerometer and gyro agree", ""};
    if (turn.tilt < kTiltWanted) {
        f.grade = Grade::untested;
        f.measured = formatted("%.1f deg of tilt, too little to tell", turn.tilt / kDegree);
        return f;
    }
    if (turn.spread < 2 * turn.best_spread || turn.spread - turn.best_spread < 0.005) {
        if (turn.spread < kMostLeft * turn.tilt * turn.tilt) return f;
        f.grade = Grade::untested;
        f.measured += ": accelerations hide it";
        return f;
    }
    f.grade = Grade::error;
    f.measured += formatted("; %.2f %% if ", 1e2 * turn.best_spread / (turn.tilt * turn.tilt));
    if (turn.best_unit != 1) {
        f.measured += "the gyro is in deg/s";
        f.advice = "the gyro is in deg/s: multiply it by pi/180";
    } else {
        f.measured += axes_text(turn.best_axes) + " (or all signs reversed)";
        f.advice = "axes of accelerometer and gyro differ; exchange or negate those of one";
    }
    return f;
}

// Readings in runs at the very same extreme value of an axis.
int clipped(const std::vector<ImuReading>& readings, Vector3d ImuReading::*sensor,
            double least_extreme) {
    int total = 0;
    for (int axis = 0; axis < 3; ++axis) {
        double low = 0, high = 0;
        for (const ImuReading& r : readings) {
            low = std::min(low, (r.*sensor)[axis]);
            high = std::max(high, (r.*sensor)[axis]);
        }
        for (const double extreme : {low, high}) {
            if (std::abs(extreme) < least_extreme) continue;
            int run = 0;
            for (const ImuReading& r : readings) {
                run = (r.*sensor)[axis] == extreme ? run + 1 : 0;
                total += run == kClippedRun ? kClippedRun : run > kClippedRun;
            }
        }
    }
    return total;
}

Finding check_range(const std::vector<ImuReading>& readings) {
    // Below these no sensor that is meant for motion ends.
    const int gyro = clipped(readings, &ImuReading::gyro, 1.5);
    const int accel = clipped(readings, &ImuReading::accel, 1.8 * kGravity);
    Finding f{Grade::ok, "IMU range",
              formatted("%d gyro and %d accelerometer values at the end of the range", gyro, accel),
              "none", ""};
    if (gyro + accel == 0) return f;
    const double share = (gyro + accel) / static_cast<double>(readings.size());
    f.grade = share > kMostClipped ? Grade::error : Grade::warning;
    f.advice = "the sensor was driven beyond its range; choose a larger one or move more gently";
    return f;
}

Finding check_frozen(const std::vector<ImuReading>& readings) {
    double longest = 0, at = 0;
    std::size_t begin = 0;
    for (std::size_t i = 1; i < readings.size(); ++i) {
        if (readings[i].gyro != readings[begin].gyro || readings[i].accel != readings[begin].accel)
            begin = i;
        const double seconds = to_seconds(readings[i].t - readings[begin].t);
        if (seconds <= longest || i - begin < 4) continue;
        longest = seconds;
        at = to_seconds(readings[begin].t - readings.front().t);
    }
    Finding f{Grade::ok, "IMU stuck", formatted("the same reading for up to %.3f s", longest),
              formatted("at most %g s", kFrozen), ""};
    if (longest > kFrozen) {
        f.grade = longest > 10 * kFrozen ? Grade::error : Grade::warning;
        f.measured += formatted(" from %.3f s", at);
        f.advice = "the driver repeats old readings; leave them out rather than fill gaps";
    }
    return f;
}

}  // namespace

std::vector<ReadingMean> reading_means(const std::vector<ImuReading>& readings, double span) {
    std::vector<ReadingMean> means;
    if (readings.size() < 2) return means;
    const double expected = span * static_cast<double>(readings.size() - 1) /
                            to_seconds(readings.back().t - readings.front().t);
    ReadingMean sum;
    int count = 0;
    long bin = 0;
    const auto close = [&] {
        if (count > 0 && count > 0.6 * expected) {
            sum.t /= count;
            sum.gyro /= count;
            sum.accel /= count;
            means.push_back(sum);
        }
        sum = {};
        count = 0;
    };
    for (const ImuReading& reading : readings) {
        const double t = to_seconds(reading.t - readings.front().t);
        if (const long now = static_cast<long>(t / span); now != bin) {
            close();
            bin = now;
        }
        sum.t += t;
        sum.gyro += reading.gyro;
        sum.accel += reading.accel;
        ++count;
    }
    close();
    return means;
}

Rest find_rest(const std::vector<ImuReading>& readings, const ImuNoise& noise) {
    Rest rest;
    std::vector<double> lengths;
    std::vector<ImuReading> stretch;
    for (std::size_t i = 0; i < readings.size();) {
        Stillness still{readings[i].t, readings[i].t + kRestStretch};
        Vector3d accel = Vector3d::Zero();
        for (stretch.clear(); i < readings.size() && readings[i].t < still.to; ++i) {
            stretch.push_back(readings[i]);
            accel += readings[i].accel;
        }
        const double length = accel.norm() / static_cast<double>(stretch.size());
        for (ImuReading& reading : stretch) reading.accel *= kGravity / length;
        if (!why_not_still(stretch, noise, still).empty()) continue;
        lengths.push_back(length);
        rest.gyro += still.gyro;
        rest.seconds += still.seconds();
    }
    if (lengths.empty()) return rest;
    rest.gyro /= static_cast<double>(lengths.size());
    rest.gravity = median(lengths);
    return rest;
}

GravityTurn gravity_turn(const std::vector<ReadingMean>& means) {
    GravityTurn turn;
    // A gyro that stands still leaves the directions as they were recorded.
    turn.tilt = std::sqrt(spread_with(means, 0, Matrix3d::Identity()));
    turn.spread = turn.best_spread = spread_with(means, 1, Matrix3d::Identity());
    for (const double unit : {1.0, kDegree})
        for (const Matrix3d& axes : signed_permutations(true)) {
            const double spread = spread_with(means, unit, axes);
            if (spread >= 0.999 * turn.best_spread) continue;
            turn.best_spread = spread;
            turn.best_axes = axes;
            turn.best_unit = unit;
        }
    return turn;
}

std::vector<Finding> check_readings(const std::vector<ImuReading>& readings,
                                    const ImuNoise& noise) {
    if (readings.size() < 2) return {};
    const std::vector<ReadingMean> means = reading_means(readings, kSpan);
    const Rest rest = find_rest(readings, noise);
    return {check_gravity(rest, means), check_gyro_at_rest(rest), check_turn(means),
            check_range(readings), check_frozen(readings)};
}

}  // namespace vio
