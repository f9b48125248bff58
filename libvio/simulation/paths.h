// Waypoints of programmed and of disturbed motions, dense enough for a spline to run through them.
#pragma once

#include <vector>

#include "libvio/simulation/random.h"
#include "libvio/simulation/trajectory.h"

namespace vio {

/// A machine that goes straight from control point to control point and stops at each, as cranes
/// and milling machines do: on each leg it speeds up, goes on at constant speed and brakes.
/// Attitudes turn by the shortest way, in step with the position. Two control points with the same
/// pose make a rest.
/// `ramp`: time of speeding up and of braking [s], at most half of a leg's time; the acceleration
/// is smooth. `spacing`: time between the waypoints [s], shortened to meet the control points.
/// Throws InputError for fewer than two control points or times that do not increase.
std::vector<Waypoint> straight_legs(const std::vector<Waypoint>& control_points, double ramp,
                                    double spacing);

/// Oscillation on top of a motion: swinging of a crane's platform, shaking of a vehicle.
struct Shake {
    double angle = 0;     ///< standard deviation of the rotation about each axis of B [rad]
    double distance = 0;  ///< standard deviation of the displacement along each axis of W [m]
    double rate = 1;      ///< mean frequency; components lie within a factor of two of it [Hz]
};

/// Adds random oscillations (sums of sines) to waypoints. They set in and die away over one period
/// at the ends, so that a motion from rest to rest stays one.
std::vector<Waypoint> shaken(std::vector<Waypoint> points, const Shake& shake, Random& random);

}  // namespace vio
