#include "libvio/simulation/vehicle_sensors.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "libvio/base/angles.h"

namespace vio {
namespace {

// The pose on the ground plane: x, y and yaw.
Pose on_ground(const Pose& T_W_B) {
    const double yaw = std::atan2(T_W_B.R(1, 0), T_W_B.R(0, 0));
    return {Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix(),
            {T_W_B.p.x(), T_W_B.p.y(), 0}};
}

struct Slip {
    double begin, end;
    Eigen::Vector3d way_B;
};

// Middles of the longest rests; random times where there are not enough.
std::vector<double> slip_times(const Trajectory& trajectory, double begin, double end,
                               const OdometryModel& model, Random& random) {
    constexpr double kStep = 0.1, kRest = 1e-3, kShortest = 1;  // [s], [m/s], [s]
    std::vector<std::pair<double, double>> rests;               // duration, middle
    double since = -1;
    // The vehicle's waits before its first move and after its last one are no obstacles.
    bool moved = false;
    for (double t = begin; t < end; t += kStep) {
        const bool still = trajectory.at(t).v_W.norm() < kRest;
        if (still && moved && since < 0) since = t;
        if (!still && since >= 0) {
            if (t - since > kShortest) rests.emplace_back(t - since, (since + t) / 2);
            since = -1;
        }
        moved = moved || !still;
    }
    std::stable_sort(rests.begin(), rests.end(),
                     [](const auto& a, const auto& b) { return a.first > b.first; });
    std::vector<double> times;
    for (int i = 0; i < model.slips; ++i)
        times.push_back(i < static_cast<int>(rests.size()) ? rests[i].second
                                                           : random.uniform(begin, end));
    std::sort(times.begin(), times.end());
    return times;
}

// How far a slip has run at time t, 0 to 1 and back to `left`.
double excursion(const Slip& slip, double t, double left) {
    const double u = (t - slip.begin) / (slip.end - slip.begin);
    if (u <= 0) return 0;
    if (u >= 1) return left;
    const double bump = 0.5 - 0.5 * std::cos(2 * std::numbers::pi * u);
    return u < 0.5 ? bump : left + (1 - left) * bump;
}

}  // namespace

void OdometryModel::describe(OptionSet& set) {
    set.section("odometry");
    set.add("make", &make, "write wheel odometry");
    set.add("rate", &rate, "Hz", {0.01, 1000}, "messages per second");
    set.add("scale_sigma", &scale_sigma, "-", {0, 0.5}, "error of the wheels' radius, 1 sigma");
    set.add("distance_noise", &distance_noise, "m/sqrt(m)", {0, 10},
            "random walk with the distance, along and across");
    set.add("yaw_noise", &yaw_noise_deg, "deg/sqrt(m)", {0, 90},
            "random walk of the heading with the distance");
    set.add("slips", &slips, "-", {0, 1e4},
            "times at which wheels spin on an obstacle, in the longest rests");
    set.add("slip_distance", &slip_distance, "m", {0, 100}, "how far odometry then runs off");
    set.add("slip_duration", &slip_duration_s, "s", {0.1, 1e4}, "out and back");
    set.add("slip_left", &slip_left, "-", {0, 1}, "share of a slip that remains");
}

SimulatedOdometry simulate_odometry(const Trajectory& trajectory, const std::vector<double>& times,
                                    const OdometryModel& model, Random& random) {
    SimulatedOdometry result;
    if (times.empty()) return result;
    const double gain = 1 + model.scale_sigma * random.normal();
    std::vector<Slip> slips;
    for (const double t : slip_times(trajectory, times.front(), times.back(), model, random)) {
        const double angle = 0.5 * random.normal(), half = model.slip_duration_s / 2;
        slips.push_back({t - half, t + half,
                         model.slip_distance * random.uniform(0.6, 1.4) *
                             Eigen::Vector3d(std::cos(angle), std::sin(angle), 0)});
    }
    const auto slipped = [&](double t) {
        Eigen::Vector3d sum = Eigen::Vector3d::Zero();
        for (const Slip& slip : slips) sum += excursion(slip, t, model.slip_left) * slip.way_B;
        return sum;
    };
    const Pose first = on_ground(trajectory.at(times.front()).T_W_B);
    Pose before = first, T_O_B;
    for (size_t k = 0; k < times.size(); ++k) {
        const double t = times[k];
        const Pose now = on_ground(trajectory.at(t).T_W_B);
        if (k > 0) {
            Pose step = before.inverse() * now;
            const double distance = step.p.norm(), root = std::sqrt(distance);
            const double turn = model.yaw_noise_deg * kDegree * root * random.normal();
            step.p = gain * step.p + (slipped(t) - slipped(times[k - 1]));
            step.p.head<2>() += model.distance_noise * root * random.normal2();
            step.R = step.R * Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()).toRotationMatrix();
            T_O_B = on_ground(T_O_B * step);
        }
        before = now;
        result.messages.push_back({from_seconds(t), T_O_B});
        result.truth.push_back(first.inverse() * now);
        result.slipping.push_back(std::any_of(slips.begin(), slips.end(), [&](const Slip& slip) {
            return slip.begin < t && t < slip.end;
        }));
    }
    return result;
}

void GpsModel::describe(OptionSet& set) {
    set.section("gps");
    set.add("make", &make, "write GPS fixes (NMEA GGA)");
    set.add("rate", &rate, "Hz", {0.01, 100}, "fixes per second");
    set.add("latitude", &origin.latitude_deg, "deg", {-90, 90}, "of the origin of W");
    set.add("longitude", &origin.longitude_deg, "deg", {-180, 180}, "of the origin of W");
    set.add("altitude", &origin.altitude_m, "m", {-500, 1e5}, "of the origin of W");
    set.add("noise", &noise, "m", {0, 100},
            "white, 1 sigma per horizontal axis; vertical errors are 1.7 times as large");
    set.add("wander", &wander, "m", {0, 100}, "slowly varying error, 1 sigma per axis");
    set.add("wander_time", &wander_time_s, "s", {0.1, 1e5}, "its time constant");
    set.add("satellite_change_interval", &satellite_change_interval_s, "s", {0.1, 1e6},
            "mean time between changes of the satellites in use");
    set.add("satellite_jump", &satellite_jump, "m", {0, 1000},
            "constant error with each set of satellites, 1 sigma per axis");
}

SimulatedGps simulate_gps(const Trajectory& trajectory, const std::vector<double>& times,
                          const GpsModel& model, Random& random) {
    SimulatedGps result;
    const Eigen::Vector3d shape(1, 1, GpsModel::kVertical);
    const auto drawn = [&](double sigma) -> Eigen::Vector3d {
        return sigma * shape.cwiseProduct(random.normal3());
    };
    Eigen::Vector3d offset = drawn(model.satellite_jump), wander = drawn(model.wander);
    for (size_t k = 0; k < times.size(); ++k) {
        bool changed = false;
        if (k > 0) {
            const double dt = times[k] - times[k - 1];
            const double kept = std::exp(-dt / model.wander_time_s);
            wander = kept * wander + drawn(model.wander * std::sqrt(1 - kept * kept));
            changed = random.uniform() < 1 - std::exp(-dt / model.satellite_change_interval_s);
            if (changed) offset = drawn(model.satellite_jump);
        }
        const Eigen::Vector3d truth = trajectory.at(times[k]).T_W_B.p;
        const Eigen::Vector3d error = offset + wander + drawn(model.noise);
        const Geodetic place = geodetic_from_enu(truth + error, model.origin);
        result.messages.push_back(
            {from_seconds(times[k]), place.latitude_deg, place.longitude_deg, place.altitude_m, 1});
        result.truth_enu.push_back(truth);
        result.error_enu.push_back(error);
        result.satellites_changed.push_back(changed);
    }
    return result;
}

}  // namespace vio
