#include "libvio/simulation/paths.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "libvio/base/errors.h"
#include "libvio/geometry/so3.h"

namespace vio {
namespace {

// 0 to 1 over u = 0..1 with two vanishing derivatives at both ends.
double smooth_step(double u) {
    u = std::clamp(u, 0.0, 1.0);
    return u * u * u * (10 + u * (-15 + 6 * u));
}

// Its integral from 0 to u, u in 0..1.
double smooth_step_integral(double u) {
    return u * u * u * u * (2.5 + u * (-3 + u));
}

// Share of a leg of duration T that is done at time t, with ramps of duration r at its ends.
double share_of_leg(double t, double T, double r) {
    const double speed = 1 / (T - r);
    if (t >= T) return 1;
    if (t < r) return speed * r * smooth_step_integral(t / r);
    if (t > T - r) return 1 - speed * r * smooth_step_integral((T - t) / r);
    return speed * (t - r / 2);
}

// Random smooth function of time or place with standard deviation 1.
class Oscillation {
 public:
    Oscillation(double rate, Random& random) {
        for (Sine& sine : sines_) {
            sine.rate = 2 * std::numbers::pi * rate * std::exp2(random.uniform(-1, 1));
            sine.phase = random.uniform(0, 2 * std::numbers::pi);
        }
    }
    double at(double t) const {
        double sum = 0;
        for (const Sine& sine : sines_) sum += std::sin(sine.rate * t + sine.phase);
        return sum * std::sqrt(2.0 / kSines);
    }

 private:
    static constexpr int kSines = 6;
    struct Sine {
        double rate, phase;  // [rad/s], [rad]
    };
    Sine sines_[kSines];
};

// A curve on the ground, by the distance travelled.
class Route {
 public:
    explicit Route(const std::vector<Eigen::Vector2d>& points) : curve_(through(points)) {
        constexpr double kStep = 0.01;
        const int n = static_cast<int>(std::ceil((curve_.end() - curve_.begin()) / kStep));
        for (int i = 0; i <= n; ++i) {
            parameters_.push_back(curve_.begin() + (curve_.end() - curve_.begin()) * i / n);
            const double step = i == 0 ? 0 : (at(i) - at(i - 1)).norm();
            distances_.push_back(i == 0 ? 0 : distances_.back() + step);
        }
    }

    double length() const { return distances_.back(); }

    /// Position, and the direction of travel [rad], at a distance from the start.
    std::pair<Eigen::Vector2d, double> at_distance(double s) const {
        const auto next = std::upper_bound(distances_.begin() + 1, distances_.end() - 1, s);
        const auto i = next - distances_.begin();
        const double share = (s - distances_[i - 1]) / (distances_[i] - distances_[i - 1]);
        const double u = parameters_[i - 1] + share * (parameters_[i] - parameters_[i - 1]);
        const Eigen::Vector2d tangent = curve_.evaluate(u, 1);
        return {curve_.evaluate(u, 0), std::atan2(tangent.y(), tangent.x())};
    }

 private:
    Eigen::Vector2d at(int i) const { return curve_.evaluate(parameters_[i], 0); }

    static BSpline through(const std::vector<Eigen::Vector2d>& points) {
        std::vector<double> chord;
        Eigen::MatrixXd values(points.size(), 2);
        for (size_t i = 0; i < points.size(); ++i) {
            chord.push_back(i == 0 ? 0 : chord.back() + (points[i] - points[i - 1]).norm());
            values.row(static_cast<Eigen::Index>(i)) = points[i];
        }
        return BSpline::interpolating(chord, values, CurveEnds::kFree);
    }

    BSpline curve_;
    std::vector<double> parameters_, distances_;
};

// A stretch of a drive: from distance s0 on, `move` metres in `time`, then rest.
struct Move {
    double t0, s0, move, time, rest;
};

std::vector<Move> planned(double length, const Drive& drive, Random& random) {
    std::vector<double> places{0}, rests;
    double resting = 0;
    for (int i = 0; i < drive.stops; ++i) {
        // Spread over the route: a stop in each of as many equal parts.
        places.push_back(length * (i + random.uniform(0.1, 0.9)) / drive.stops);
        rests.push_back(drive.stop_duration * random.uniform(0.5, 1.5));
        resting += rests.back();
    }
    places.push_back(length);
    rests.push_back(0);
    const double moving = drive.duration - resting;
    const double speed = length / (moving - (drive.stops + 1) * drive.ramp);
    if (!(speed > 0))
        throw InputError("trajectory: " + std::to_string(drive.stops) + " stops of " +
                         std::to_string(drive.stop_duration) +
                         " s leave no time to move; shorten them or drive longer");
    std::vector<Move> moves;
    double t = 0;
    for (size_t i = 0; i + 1 < places.size(); ++i) {
        const double distance = places[i + 1] - places[i], time = distance / speed + drive.ramp;
        moves.push_back({t, places[i], distance, time, rests[i]});
        t += time + rests[i];
    }
    return moves;
}

}  // namespace

std::vector<Waypoint> straight_legs(const std::vector<Waypoint>& control_points, double ramp,
                                    double spacing) {
    if (control_points.size() < 2)
        throw InputError("trajectory: fewer than two control points; give at least two");
    std::vector<Waypoint> points{control_points.front()};
    for (size_t i = 1; i < control_points.size(); ++i) {
        const Waypoint &from = control_points[i - 1], &to = control_points[i];
        const double T = to.t - from.t;
        if (!(T > 0))
            throw InputError("trajectory (t = " + std::to_string(to.t) +
                             " s): time does not increase; sort the control points");
        const double r = std::min(ramp, T / 2);
        const Eigen::Vector3d turn = so3::log(from.T_W_B.R.transpose() * to.T_W_B.R);
        const int n = std::max(1, static_cast<int>(std::ceil(T / spacing)));
        for (int k = 1; k <= n; ++k) {
            const double t = T * k / n, share = share_of_leg(t, T, r);
            points.push_back({from.t + t,
                              {from.T_W_B.R * so3::exp(share * turn),
                               from.T_W_B.p + share * (to.T_W_B.p - from.T_W_B.p)}});
        }
    }
    return points;
}

std::vector<Waypoint> drive_along(const std::vector<Eigen::Vector2d>& points, const Drive& drive,
                                  double spacing, Random& random) {
    const Route route(points);
    const std::vector<Move> moves = planned(route.length(), drive, random);
    std::vector<Oscillation> ground;  // height, pitch, roll
    for (int i = 0; i < 3; ++i) ground.emplace_back(1 / drive.roughness_length, random);
    std::vector<Waypoint> waypoints;
    const int n = static_cast<int>(std::ceil(drive.duration / spacing));
    auto move = moves.begin();
    for (int k = 0; k <= n; ++k) {
        const double t = drive.duration * k / n;
        while (move + 1 != moves.end() && (move + 1)->t0 <= t) ++move;
        const double r = std::min(drive.ramp, move->time / 2);
        const double s = move->s0 + move->move * share_of_leg(t - move->t0, move->time, r);
        const auto [xy, yaw] = route.at_distance(s);
        using Eigen::AngleAxisd, Eigen::Vector3d;
        const Eigen::Matrix3d R =
            (AngleAxisd(yaw, Vector3d::UnitZ()) *
             AngleAxisd(drive.roughness_angle * ground[1].at(s), Vector3d::UnitY()) *
             AngleAxisd(drive.roughness_angle * ground[2].at(s), Vector3d::UnitX()))
                .toRotationMatrix();
        waypoints.push_back({t, {R, {xy.x(), xy.y(), drive.roughness_height * ground[0].at(s)}}});
    }
    return waypoints;
}

std::vector<Waypoint> shaken(std::vector<Waypoint> points, const Shake& shake, Random& random) {
    std::vector<Oscillation> sway;
    for (int i = 0; i < 6; ++i) sway.emplace_back(shake.rate, random);
    const double begin = points.front().t, end = points.back().t;
    for (Waypoint& point : points) {
        const double onset =
            smooth_step((point.t - begin) * shake.rate) * smooth_step((end - point.t) * shake.rate);
        const auto vector = [&](int first) -> Eigen::Vector3d {
            return onset * Eigen::Vector3d(sway[first].at(point.t), sway[first + 1].at(point.t),
                                           sway[first + 2].at(point.t));
        };
        point.T_W_B.p += shake.distance * vector(0);
        point.T_W_B.R = point.T_W_B.R * so3::exp(shake.angle * vector(3));
    }
    return points;
}

}  // namespace vio
