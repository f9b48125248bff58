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

// Random smooth function of time with standard deviation 1.
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
