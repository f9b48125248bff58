// Integration of inertial readings over constant segments: the one place where gyro and
// accelerometer become motion. The batch estimator's preintegration and the recursive estimator's
// propagation both step through here.
//
// Over a segment of length dt with constant angular velocity w and specific force a in the IMU
// frame (bias removed), with phi = w dt:
//   R <- R exp(phi)                                                    Eqs. (5)-(8)
//   p <- p + v dt + g dt^2/2 + R G2(phi) a dt^2                        Eq. (10)
//   v <- v + g dt + R G1(phi) a dt                                     Eqs. (9), (11)
// The paper takes a constant in the world (G1 = I, G2 = I/2); it is the body that it is constant
// in, so the exact integrals are used, with S = skew(phi) and |phi| = f:
//   G1 = I + (1 - cos f)/f^2 S + (f - sin f)/f^3 S^2            = I + S/2 + S^2/6 + O(f^3)
//   G2 = I/2 + (f - sin f)/f^3 S + (f^2/2 - 1 + cos f)/f^4 S^2  = I/2 + S/6 + S^2/24 + O(f^3)
#pragma once

#include <Eigen/Dense>
#include <optional>
#include <vector>

#include "libvio/base/types.h"

namespace vio {

using Matrix9d = Eigen::Matrix<double, 9, 9>;
using Matrix93d = Eigen::Matrix<double, 9, 3>;

/// Attitude, position and velocity of the IMU. Error order (rotation, position, velocity), the
/// rotation perturbed on the right.
struct InertialState {
    Eigen::Matrix3d R = Eigen::Matrix3d::Identity();  ///< R_W_I
    Eigen::Vector3d p = Eigen::Vector3d::Zero();      ///< p_W_I [m]
    Eigen::Vector3d v = Eigen::Vector3d::Zero();      ///< v_W [m/s]
};

/// Constant angular velocity and specific force over a time dt.
struct ImuSegment {
    double dt = 0;                                    ///< [s]
    Eigen::Vector3d gyro = Eigen::Vector3d::Zero();   ///< measured [rad/s]
    Eigen::Vector3d accel = Eigen::Vector3d::Zero();  ///< measured [m/s^2]
};

/// Derivatives of one step: d(state after) = F d(state before) + G_gyro d(w) + G_accel d(a).
struct IntegrationJacobian {
    Matrix9d F;
    Matrix93d G_gyro, G_accel;
};

/// Advances the state over one segment. gyro and accel are without bias; g_W in m/s^2 (zero for
/// preintegration). The Jacobian, if asked for, is taken at the state before the step.
void integrate(InertialState& state, const ImuSegment& unbiased, const Eigen::Vector3d& g_W,
               IntegrationJacobian* jacobian = nullptr);

/// Covariance that white noise of the readings adds to the state over one step of dt: densities^2
/// in rad^2/s and m^2/s^3, here of the measurement, so that their means over dt have variances
/// density^2 / dt. What noise does to the position within the step (accel_density2 dt^3 / 12 beyond
/// its mean's dt^3 / 4) is in it, so that a single step's covariance is regular too.
Matrix9d white_noise(const IntegrationJacobian& jacobian, double gyro_density2,
                     double accel_density2, double dt);

/// Reading at t on the line through two readings; a's where b is not later.
ImuReading interpolated(const ImuReading& a, const ImuReading& b, TimeNs t);

/// Readings in order of time, from which segments between any two times are cut.
class ImuSequence {
 public:
    ImuSequence() = default;
    /// Readings must be strictly increasing in time; throws InputError otherwise.
    explicit ImuSequence(std::vector<ImuReading> readings);

    /// Appends a reading; throws InputError if it is not later than the last.
    void push_back(const ImuReading& reading);
    /// Forgets readings that no segment after t needs (the last one at or before t is kept).
    void drop_before(TimeNs t);

    bool empty() const { return readings_.empty(); }
    const std::vector<ImuReading>& readings() const { return readings_; }
    bool covers(TimeNs begin, TimeNs end) const;

    /// Reading at time t by linear interpolation, nothing outside the sequence.
    std::optional<ImuReading> interpolate(TimeNs t) const;

    /// Segments that fill [begin, end], cut at every reading; each carries the mean of the linearly
    /// interpolated readings at its ends. Nothing if the interval is not covered.
    std::optional<std::vector<ImuSegment>> segments(TimeNs begin, TimeNs end) const;

    /// Longest time between consecutive readings that overlaps [begin, end] [s].
    double largest_gap(TimeNs begin, TimeNs end) const;

 private:
    std::vector<ImuReading> readings_;
};

}  // namespace vio
