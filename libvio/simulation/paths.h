// Waypoints of programmed and of disturbed motions, dense enough for a spline to run through them.
#pragma once

#include <Eigen/Dense>
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

/// How a ground vehicle drives.
struct Drive {
    double duration = 60;         ///< [s]
    int stops = 0;                ///< rests on the way, at random places
    double stop_duration = 5;     ///< mean; each lasts half as long to half as long again [s]
    double ramp = 1;              ///< time of speeding up and of braking [s]
    double roughness_angle = 0;   ///< standard deviation of pitch and roll on the ground [rad]
    double roughness_height = 0;  ///< standard deviation of the ground's height [m]
    double roughness_length = 2;  ///< mean wave length of both [m]
};

/// Drives along a smooth curve through the route's points (x, y) on the ground z = 0, B's x axis
/// forward and z axis up, at one speed between stops. Uneven ground disturbs height, pitch and roll
/// by the place, so that a vehicle at rest is at rest. Throws InputError for a route of fewer than
/// two points or if the stops leave no time to move.
std::vector<Waypoint> drive_along(const std::vector<Eigen::Vector2d>& route, const Drive& drive,
                                  double spacing, Random& random);

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
