// Readings of an IMU that moves along a trajectory.
#pragma once

#include <vector>

#include "libvio/base/types.h"
#include "libvio/imu/noise.h"
#include "libvio/imu/preintegration.h"
#include "libvio/simulation/random.h"
#include "libvio/simulation/trajectory.h"

namespace vio {

/// What is wrong with an IMU. reading = gain * (true + ...) as written at simulate_imu().
struct ImuErrors {
    ImuNoise noise;
    ImuBias initial_bias;  ///< at the first reading
    /// Scale factors and misalignment of the axes: measured = gain * true. Identity: perfect.
    Eigen::Matrix3d gyro_gain = Eigen::Matrix3d::Identity();
    Eigen::Matrix3d accel_gain = Eigen::Matrix3d::Identity();
    double gyro_limit = 0, accel_limit = 0;  ///< saturation per axis [rad/s], [m/s^2]; 0: none
    double gyro_step = 0, accel_step = 0;    ///< quantisation [rad/s], [m/s^2]; 0: none
};

/// Readings in I, in order of time, and the truth about their biases.
struct SimulatedImu {
    std::vector<ImuReading> readings;
    std::vector<ImuBias> biases;  ///< true bias at each reading
};

/// Times of readings that cover [begin, end] [s]: equally spaced at `rate` [Hz], each displaced by
/// a normal deviate of standard deviation `jitter` [s], limited to 0.4 of the spacing so that the
/// order stays. Multiples of 100 ns, the resolution of rawlog time stamps.
std::vector<double> imu_times(double begin, double end, double rate, double jitter, Random& random);

/// Angular velocity and specific force a = R_I_W (a_W - g_W) of the IMU at T_B_I, at the given
/// times (nanoseconds of the readings are counted from t = 0).
///
/// Like a strapdown sensor that integrates internally, each reading takes up what integration of
/// the previous ones over their intervals has missed (coning and sculling included). So integrating
/// them (ImuSequence::segments) returns to the trajectory with an error that does not grow, however
/// long it is; no alternation from reading to reading arises. Segments are also cut at `cuts` [s],
/// in order of time: the times of images, to and from which estimators integrate.
std::vector<ImuReading> ideal_imu(const Trajectory& trajectory, const Pose& T_B_I,
                                  const Eigen::Vector3d& g_W, const std::vector<double>& times,
                                  const std::vector<double>& cuts = {});

/// Adds the errors: quantised(limited(gain * ideal + bias + white noise)). The white noise of a
/// reading has variance density^2 * rate with the mean rate of the readings; the bias walks with
/// variance random_walk^2 * dt.
SimulatedImu with_errors(const std::vector<ImuReading>& ideal, const ImuErrors& errors,
                         Random& random);

}  // namespace vio
