// Noise of an IMU from a recording at rest.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "libvio/base/types.h"
#include "libvio/imu/noise.h"

namespace vio {

/// Allan variance of one averaging time, from pairs of neighbouring averages that share no reading:
/// the variance of Haar wavelet coefficients, which of white noise are independent.
struct AllanLevel {
    double tau = 0;       ///< averaging time [s]
    double variance = 0;  ///< [unit^2], unit: that of the readings
    double pairs = 0;     ///< degrees of freedom
};

/// Levels at tau = 2^j times the interval of the readings, j = 0, 1, ..., as long as there are four
/// pairs. interval [s].
std::vector<AllanLevel> allan_levels(const std::vector<double>& readings, double interval);

/// A value and its standard deviation.
struct Estimated {
    double value = 0, sigma = 0;
    /// Upper end of a one-sided 95 % interval; of a value that is not determined, what is known.
    double bound = 0;
    /// False where the readings allow zero (less than two standard deviations, of its square).
    bool determined = false;
};

/// What makes up the variance (IEEE Std 952): N^2 / tau + (2 ln 2 / pi) B^2 + K^2 tau / 3.
struct AllanFit {
    Estimated noise_density;     ///< N [unit / sqrt(Hz)], white noise
    Estimated bias_instability;  ///< B [unit], flicker; zero unless the readings ask for it
    Estimated random_walk;       ///< K [unit / s / sqrt(Hz)], of the bias
    /// Chi-square of the levels over its degrees of freedom: near 1 where the model holds.
    double misfit = 0;
};

/// Maximum likelihood over the levels from min_tau [s] on, below which filters within the sensor
/// rule; standard deviations from the Fisher information. Flicker is taken in where it raises the
/// likelihood significantly (1 %). Throws InputError for fewer than four levels.
AllanFit fit_allan(const std::vector<AllanLevel>& levels, double min_tau = 0.1);

/// The random walk by which an estimator without flicker covers both: K^2 + 3 F^2 / N^2 with
/// F = (2 ln 2 / pi) B^2, the walk that reaches the flicker's level F where that leaves the white
/// noise behind, at tau = N^2 / F. The bound of K where neither is determined.
double covering_random_walk(const AllanFit& fit);

/// What a recording at rest tells.
struct ImuNoiseEstimate {
    /// Of the gyro or the accelerometer.
    struct Sensor {
        std::array<AllanFit, 3> axes;    ///< x, y, z
        AllanFit all;                    ///< of the three together: their mean variance
        std::vector<AllanLevel> levels;  ///< of the three together
    };
    Sensor gyro, accel;
    ImuNoise noise;                     ///< densities and walks for the estimators
    double rate = 0;                    ///< readings a second [1/s]
    TimeNs first = 0, last = 0;         ///< the stretch that was used
    std::vector<std::string> warnings;  ///< too short, moved, gaps, another kind of noise
};

/// From the longest stretch without motion and without gaps. Motion: the mean of a second departs
/// from its neighbour's by more than ten times what is usual, or from the median by more than
/// 0.02 rad/s or 0.3 m/s^2. Throws InputError (the reason only) where no stretch is at least 60 s
/// long.
ImuNoiseEstimate estimate_imu_noise(const std::vector<ImuReading>& readings);

}  // namespace vio
