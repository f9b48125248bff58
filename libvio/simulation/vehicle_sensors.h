// Wheel odometry and GPS of a ground vehicle, with the errors that they have in the field.
#pragma once

#include <vector>

#include "libvio/base/options.h"
#include "libvio/geometry/geodetic.h"
#include "libvio/io/recording.h"
#include "libvio/simulation/random.h"
#include "libvio/simulation/trajectory.h"

namespace vio {

/// Rate and errors of wheel odometry.
struct OdometryModel {
    bool make = false;
    double rate = 10;               ///< [Hz]
    double scale_sigma = 0.003;     ///< of the wheels' radius [-]
    double distance_noise = 0.005;  ///< 1 sigma after one metre, along and across [m/sqrt(m)]
    double yaw_noise_deg = 0.1;     ///< 1 sigma after one metre [deg/sqrt(m)]
    /// Wheels spin while the vehicle is held up: odometry runs off by slip_distance and comes back,
    /// as far as slip_left, when the driver backs off.
    int slips = 0;
    double slip_distance = 1;    ///< [m]
    double slip_duration_s = 6;  ///< out and back
    double slip_left = 0.05;     ///< share that remains

    void describe(OptionSet& options);
};

/// Odometry with its truth, message by message.
struct SimulatedOdometry {
    std::vector<OdometryMessage> messages;  ///< T_O_B is planar; O is B at the first
    std::vector<Pose> truth;                ///< T_O_B without errors, in the plane
    std::vector<bool> slipping;
};

/// Slips happen where the vehicle rests, while it has rests that last; else anywhere. times [s] in
/// order; the messages' stamps are nanoseconds of the trajectory's time.
SimulatedOdometry simulate_odometry(const Trajectory& trajectory, const std::vector<double>& times,
                                    const OdometryModel& model, Random& random);

/// Rate, place and errors of a GPS receiver.
struct GpsModel {
    bool make = false;
    double rate = 1;                           ///< [Hz]
    Geodetic origin{-20.9, -69.9, 1000};       ///< of W; x is east, y north
    double noise = 0.1;                        ///< white, 1 sigma per horizontal axis [m]
    double wander = 0.5, wander_time_s = 60;   ///< correlated error: 1 sigma [m], time constant
    double satellite_change_interval_s = 120;  ///< mean
    double satellite_jump = 2;                 ///< step at each change, 1 sigma per axis [m]
    /// Vertical errors are this much larger.
    static constexpr double kVertical = 1.7;

    void describe(OptionSet& options);
};

/// Fixes with their truth, message by message.
struct SimulatedGps {
    std::vector<GpsMessage> messages;
    std::vector<Eigen::Vector3d> truth_enu;  ///< position of B's origin in W [m]
    std::vector<Eigen::Vector3d> error_enu;  ///< [m]
    std::vector<bool> satellites_changed;    ///< since the fix before
};

/// With each set of satellites the fixes are off by another vector; it is drawn anew, not added, at
/// every change.
SimulatedGps simulate_gps(const Trajectory& trajectory, const std::vector<double>& times,
                          const GpsModel& model, Random& random);

}  // namespace vio
