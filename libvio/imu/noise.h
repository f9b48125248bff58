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
    /// Gyro errors that follow the motion (scale, alignment, time stamps) as a share of what is
    /// measured [-]; 0 for an ideal gyro. Real ones are specified to about 1 %. (The
    /// accelerometer's are mostly constant: its bias takes them up.)
    double gyro_sensitivity_error = 0.003;

    /// Squared noise density [(rad/s)^2/Hz] of a gyro that measures this rate [rad/s]: the white
    /// noise, and the errors that follow the motion as noise that keeps its sign for a while.
    double gyro_density2(double rate) const {
        constexpr double kAlike = 0.25;  // [s]: how long lively motion keeps its direction
        const double following = gyro_sensitivity_error * rate;
        return gyro_noise_density * gyro_noise_density + following * following * kAlike;
    }
};

}  // namespace vio
