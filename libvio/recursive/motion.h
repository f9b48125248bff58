// Motion models: how the core moves between measurements, section 5.3.
#pragma once

#include <memory>

#include "libvio/imu/noise.h"
#include "libvio/imu/preintegration.h"
#include "libvio/recursive/filter_state.h"

namespace vio {

/// Random walks of the models that assume smooth motion.
struct SmoothnessVariances {
    double angular_rate = 1e2;    ///< [(rad/s)^2/s]
    double acceleration = 1e2;    ///< [(m/s^2)^2/s]
    double image_rotation = 0.3;  ///< image-only [rad^2/s]
    double image_position = 0.3;  ///< image-only [m^2/s]
};

/// How mean and covariance of the core go from one time to the next.
class MotionModel {
 public:
    virtual ~MotionModel() = default;

    /// Moves the state from one time to the next: Eqs. (14)-(21). Both readings are in the IMU
    /// frame, biased as measured; a model that does not use them reads their times only.
    /// interval: between the sensor's readings from which these two are interpolated [s].
    virtual void advance(FilterState& state, const ImuReading& from, const ImuReading& to,
                         double interval = 0) const = 0;

    /// Takes a reading in as a measurement of the state, Eq. (23), where the model does so. A
    /// reading is a mean over the interval [s] since the one before: its variance is density^2 /
    /// interval.
    virtual void measure(FilterState& state, const ImuReading& reading, double interval) const = 0;

    /// First core from the errors e of StateIndex's components with the given covariance. lift
    /// receives the matrix with core error = lift e + what is independent of it.
    virtual FilterState start(const CoreState& mean, const Matrix15d& covariance,
                              const ImuReading& reading, bool invariant,
                              CoreMatrix* lift) const = 0;
};

/// Readings drive the motion: attitude, position and velocity are integrated from the mean of
/// consecutive readings, whose noise is the process noise; biases are random walks.
std::unique_ptr<MotionModel> make_imu_driven_motion(const ImuNoise& noise);

/// The paper's: angular velocity (in I) and acceleration (in W) are random walks; readings are
/// measurements. Gravity is part of the state; gravity_sigma [m/s^2] is its first uncertainty.
std::unique_ptr<MotionModel> make_smooth_motion(const ImuNoise& noise,
                                                const SmoothnessVariances& variances,
                                                double gravity_sigma);

/// Image-only, section 5.7: rotation and position are slow random walks.
std::unique_ptr<MotionModel> make_image_only_motion(const SmoothnessVariances& variances);

/// How fast attitude, position and velocity change, in the order of their errors, as the reading
/// says: also how their errors at an image grow with that of the time offset.
Vector9d rate_of(const CoreState& core, const ImuReading& reading);

/// Residual of Eq. (23), measured - predicted, scaled to unit noise for readings that cover dt [s];
/// H, if given, receives the derivative of the prediction.
Vector6d inertial_residual(const CoreState& core, const ImuReading& reading, const ImuNoise& noise,
                           double dt,
                           Eigen::Matrix<double, 6, static_cast<int>(CoreKind::smooth)>* H);

}  // namespace vio
