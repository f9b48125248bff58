// Readings between two images as one measurement of relative motion.
//
// Dr, Dp, Dv are the rotation, position and velocity that the readings alone give, starting from
// rest at the identity without gravity; with T the time between the images
//   R_j = R_i Dr,  p_j = p_i + v_i T + g T^2/2 + R_i Dp,  v_j = v_i + g T + R_i Dv,
// which is Eqs. (5)-(11) composed over the interval. Dr, Dp, Dv are corrected to first order when
// the biases move away from those used in the integration. Source: Lupton and Sukkarieh (2012);
// Forster et al. (2017).
#pragma once

#include <vector>

#include "libvio/imu/integration.h"
#include "libvio/imu/noise.h"

namespace vio {

/// Gyro and accelerometer bias.
struct ImuBias {
    Eigen::Vector3d gyro = Eigen::Vector3d::Zero();   ///< [rad/s]
    Eigen::Vector3d accel = Eigen::Vector3d::Zero();  ///< [m/s^2]
};

using Vector9d = Eigen::Matrix<double, 9, 1>;
using Matrix96d = Eigen::Matrix<double, 9, 6>;

/// Dr, Dp, Dv of one interval, their covariance and their derivatives by the biases.
class PreintegratedImu {
 public:
    /// Integrates the segments with the given biases. Covariance comes from the noise densities.
    PreintegratedImu(const std::vector<ImuSegment>& segments, const ImuBias& bias,
                     const ImuNoise& noise);

    double duration() const { return duration_; }  ///< T [s]
    const Matrix9d& covariance() const {
        return covariance_;
    }  ///< of (rotation, position, velocity)
    const InertialState& delta() const { return delta_; }

    /// State at the end of the interval from that at its beginning.
    InertialState predict(const InertialState& i, const ImuBias& bias,
                          const Eigen::Vector3d& g_W) const;

    /// Derivatives of the residual in the orders (rotation, position, velocity) for states,
    /// (gyro, accel) for the bias, and g_W.
    struct Jacobian {
        Matrix9d state_i, state_j;
        Matrix96d bias;
        Matrix93d gravity;
    };

    /// Residual of Eq. (4), (rotation [rad], position [m], velocity [m/s]) in the IMU frame at i:
    /// zero when the two states agree with the readings.
    Vector9d residual(const InertialState& i, const InertialState& j, const ImuBias& bias,
                      const Eigen::Vector3d& g_W, Jacobian* J = nullptr) const;

 private:
    InertialState corrected(const ImuBias& bias) const;

    double duration_ = 0;
    InertialState delta_;
    ImuBias bias_;
    Matrix96d d_bias_ = Matrix96d::Zero();
    Matrix9d covariance_ = Matrix9d::Zero();
};

}  // namespace vio
