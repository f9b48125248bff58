#include "libvio/simulation/scenario_motion.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "libvio/base/angles.h"
#include "libvio/simulation/paths.h"
#include "libvio/simulation/scenario_text.h"

namespace vio {
namespace {

std::vector<Waypoint> control_points(const std::string& text) {
    std::vector<Waypoint> points;
    std::istringstream in(text);
    for (std::string point; std::getline(in, point, ',');) {
        const auto v = numbers_in(point, "[trajectory] waypoints", 7);
        points.push_back({v[0], pose_from(&v[1])});
    }
    return points;
}

std::vector<Eigen::Vector2d> route_points(const std::string& text) {
    std::vector<Eigen::Vector2d> points;
    std::istringstream in(text);
    for (std::string point; std::getline(in, point, ',');) {
        const auto v = numbers_in(point, "[trajectory] route", 2);
        points.emplace_back(v[0], v[1]);
    }
    return points;
}

std::vector<Waypoint> sampled(const Trajectory& trajectory, double spacing) {
    std::vector<Waypoint> points;
    const double begin = trajectory.begin(), length = trajectory.end() - begin;
    const int n = static_cast<int>(std::ceil(length / spacing));
    for (int i = 0; i <= n; ++i) {
        const double t = begin + length * i / n;
        points.push_back({t, trajectory.at(t).T_W_B});
    }
    return points;
}

}  // namespace

void ScenarioMotion::describe(OptionSet& set) {
    set.section("trajectory");
    set.add("path", &path, {"curve", "legs", "drive"},
            "through the waypoints along one smooth curve (curve), straight and stopping at each "
            "(legs), or along the route as ground vehicles go (drive)");
    set.add("waypoints", &waypoints,
            "curve, legs: control points t x y z yaw pitch roll [s, m, deg] of the body in W, "
            "separated by commas");
    set.add("at_rest", &at_rest, "curve: starts from rest and comes to rest");
    set.add("route", &route, "drive: points x y [m] on the ground, separated by commas");
    set.add("duration", &duration_s, "s", {0.1, 1e6}, "drive: from the first to the last move");
    set.add("stops", &stops, "-", {0, 1e5}, "drive: rests on the way, at random");
    set.add("stop_duration", &stop_duration_s, "s", {0, 1e5}, "drive: mean length of a rest");
    set.add("roughness_angle", &roughness_angle_deg, "deg", {0, 45},
            "drive: pitch and roll on uneven ground, 1 sigma");
    set.add("roughness_height", &roughness_height, "m", {0, 10},
            "drive: height of uneven ground, 1 sigma");
    set.add("roughness_length", &roughness_length, "m", {0.1, 1000},
            "drive: mean wave length of uneven ground");
    set.add("ramp", &ramp_s, "s", {0.01, 1e4},
            "legs, drive: time of speeding up and of braking, at most half of each move's");
    set.add("shake_angle", &shake_angle_deg, "deg", {0, 90},
            "random oscillation of the attitude, 1 sigma per axis");
    set.add("shake_distance", &shake_distance, "m", {0, 10},
            "random oscillation of the position, 1 sigma per axis");
    set.add("shake_rate", &shake_rate, "Hz", {0.01, 20}, "mean frequency of the oscillations");
}

SplineTrajectory ScenarioMotion::make(std::uint64_t seed) const {
    const Shake shake{shake_angle_deg * kDegree, shake_distance, shake_rate};
    const bool shakes = shake.angle > 0 || shake.distance > 0;
    // Between waypoints: short enough to follow ramps and oscillations.
    const double spacing = std::clamp(
        std::min(path == "curve" ? 1.0 : ramp_s / 8, shakes ? 0.06 / shake_rate : 1.0), 1e-3, 0.1);
    std::vector<Waypoint> points;
    if (path == "drive") {
        Random random(seed, "drive");
        const Drive drive{duration_s,
                          stops,
                          stop_duration_s,
                          ramp_s,
                          roughness_angle_deg * kDegree,
                          roughness_height,
                          roughness_length};
        points = drive_along(route_points(route), drive, spacing, random);
    } else if (path == "legs") {
        points = straight_legs(control_points(waypoints), ramp_s, spacing);
    } else {
        points = control_points(waypoints);
    }
    const CurveEnds ends = rests_at_ends() ? CurveEnds::kAtRest : CurveEnds::kFree;
    if (shakes) {
        if (path == "curve") points = sampled(SplineTrajectory::through(points, ends), spacing);
        Random random(seed, "shake");
        points = shaken(std::move(points), shake, random);
    }
    return SplineTrajectory::through(points, ends);
}

}  // namespace vio
