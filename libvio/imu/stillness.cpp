#include "libvio/imu/stillness.h"

#include <algorithm>
#include <cstdio>

#include "libvio/base/chi_square.h"

namespace vio {

using Eigen::Vector3d;

namespace {

constexpr TimeNs kLargestGap = 100'000'000;  // between readings
constexpr int kFewestReadings = 20;
constexpr int kQuarters = 4;
constexpr double kLatest = 0.1;  // [s] at the end, judged on their own: motion that has just begun
// Densities are rarely known better than by this factor of their squares; nor is a vehicle at rest
// free of vibration.
constexpr double kNoiseMargin = 2.25;
constexpr double kProbability = 0.999;

struct Sum {
    Vector3d gyro = Vector3d::Zero(), accel = Vector3d::Zero();
    int count = 0;

    void add(const ImuReading& reading) {
        gyro += reading.gyro;
        accel += reading.accel;
        ++count;
    }
};

std::string moves(const char* what, double statistic, int degrees) {
    const double limit = kNoiseMargin * chi_square_quantile(degrees, kProbability);
    if (statistic < limit) return "";
    char text[160];
    std::snprintf(text, sizeof text, "%s %.3g times that of noise, limit %.3g", what,
                  statistic / degrees, limit / degrees);
    return text;
}

// Of the readings of one of the two sensors: the sums' and the single readings' squared deviations
// from the mean, over those of noise.
class Deviations {
 public:
    Deviations(const Vector3d& mean, double variance) : mean_(mean), variance_(variance) {}

    double of(const Vector3d& reading) const { return (reading - mean_).squaredNorm() / variance_; }
    double of(const Vector3d& sum, int count) const { return count * of(sum / count); }

 private:
    const Vector3d& mean_;
    double variance_;
};

bool without_a_hole(std::span<const ImuReading> readings, const Stillness& stretch) {
    TimeNs last = stretch.from;
    for (const ImuReading& reading : readings) {
        if (reading.t - last > kLargestGap) return false;
        last = reading.t;
    }
    return stretch.to - last < kLargestGap;
}

}  // namespace

std::string why_not_still(std::span<const ImuReading> readings, const ImuNoise& noise,
                          Stillness& stretch) {
    Sum all, latest, quarter[kQuarters];
    for (const ImuReading& reading : readings) {
        const double share = to_seconds(reading.t - stretch.from) / stretch.seconds();
        all.add(reading);
        quarter[std::clamp(static_cast<int>(kQuarters * share), 0, kQuarters - 1)].add(reading);
        if (to_seconds(stretch.to - reading.t) < kLatest) latest.add(reading);
    }
    if (all.count < kFewestReadings || latest.count == 0 || !without_a_hole(readings, stretch) ||
        std::any_of(quarter, quarter + kQuarters, [](const Sum& q) { return q.count == 0; }))
        return "too few readings";
    stretch.gyro = all.gyro / all.count;
    stretch.accel = all.accel / all.count;
    const double rate = (all.count - 1) / to_seconds(readings.back().t - readings.front().t);
    const auto variance = [&](double density) { return density * density * rate; };
    const Deviations gyro(stretch.gyro, variance(noise.gyro_noise_density));
    const Deviations accel(stretch.accel, variance(noise.accel_noise_density));
    double fast_gyro = 0, fast_accel = 0, slow_gyro = 0, slow_accel = 0;
    for (const ImuReading& reading : readings) {
        fast_gyro += gyro.of(reading.gyro);
        fast_accel += accel.of(reading.accel);
    }
    for (const Sum& q : quarter) {
        slow_gyro += gyro.of(q.gyro, q.count);
        slow_accel += accel.of(q.accel, q.count);
    }
    struct Test {
        const char* what;
        double statistic;
        int degrees;
    };
    const int single = 3 * (all.count - 1), slow = 3 * (kQuarters - 1);
    for (const Test& test :
         {Test{"spread of the gyro", fast_gyro, single},
          Test{"spread of the accelerometer", fast_accel, single},
          Test{"slow change of the gyro", slow_gyro, slow},
          Test{"slow change of the accelerometer", slow_accel, slow},
          Test{"latest change of the gyro", gyro.of(latest.gyro, latest.count), 3},
          Test{"latest change of the accelerometer", accel.of(latest.accel, latest.count), 3}})
        if (const std::string reason = moves(test.what, test.statistic, test.degrees);
            !reason.empty())
            return reason;
    return "";
}

}  // namespace vio
