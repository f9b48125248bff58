// Noise of gyro and accelerometer.
#pragma once

namespace vio {

/// White-noise densities and bias random walks of an IMU, as continuous-time densities.
/// The default is a consumer MEMS sensor.
struct ImuNoise {
    double gyro_noise_density = 1.7e-3;    ///< [rad/s/sqrt(Hz)]
    double accel_noise_density = 2e-2;     ///< [m/s^2/sqrt(Hz)]
    double gyro_bias_random_walk = 2e-5;   ///< [rad/s^2/sqrt(Hz)]
    double accel_bias_random_walk = 3e-3;  ///< [m/s^3/sqrt(Hz)]
};

}  // namespace vio
