// Time stamps, ids and the measurements that the estimators consume.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <vector>

namespace vio {

/// Nanoseconds since the UNIX epoch. Everything inside the library is timed with it.
using TimeNs = std::int64_t;
/// Stable identity of a tracked feature, hence of the landmark that it shows.
using FeatureId = std::int64_t;

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Matrix15d = Eigen::Matrix<double, 15, 15>;
using Matrix23d = Eigen::Matrix<double, 2, 3>;

inline constexpr double to_seconds(TimeNs duration) {
    return 1e-9 * static_cast<double>(duration);
}
inline constexpr TimeNs from_seconds(double seconds) {
    return static_cast<TimeNs>(seconds * 1e9 + (seconds < 0 ? -0.5 : 0.5));
}

/// One reading of gyro and accelerometer, in the IMU frame I (measured = true + bias + noise).
struct ImuReading {
    TimeNs t = 0;
    Eigen::Vector3d gyro = Eigen::Vector3d::Zero();  ///< angular velocity [rad/s]
    Eigen::Vector3d accel =
        Eigen::Vector3d::Zero();  ///< specific force [m/s^2], +g upwards at rest
};

/// The place of one feature in one image.
struct FeatureObservation {
    FeatureId feature_id = -1;
    Eigen::Vector2d uv_px =
        Eigen::Vector2d::Zero();  ///< pixel centre of the top-left pixel is (0, 0)
    /// Shape of the measurement covariance [-], to be multiplied by the estimator's sigma_px^2.
    /// Identity (isotropic) unless the tracker knows better (paper, section 4.2).
    Eigen::Matrix2d covariance_shape = Eigen::Matrix2d::Identity();
};

/// All features of one image.
struct FeatureFrame {
    TimeNs t = 0;
    std::vector<FeatureObservation> features;  ///< each feature_id at most once
};

}  // namespace vio
