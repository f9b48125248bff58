#include "libvio/simulation/statistics.h"

#include <cmath>
#include <cstdio>
#include <set>

#include "libvio/base/angles.h"
#include "libvio/geometry/so3.h"
#include "libvio/imu/preintegration.h"
#include "libvio/simulation/scenario.h"

namespace vio {
namespace {

constexpr double kStep = 2e-3;  // of sums along the path [s]

std::string text(const char* format, double value, int decimals) {
    char buffer[64];
    std::snprintf(buffer, sizeof buffer, format, decimals, value);
    return buffer;
}

void add_path(const Simulation& simulation, ExperimentStatistics& s) {
    const Trajectory& trajectory = simulation.trajectory();
    const double begin = simulation.seconds(simulation.image_times().front());
    const int steps = static_cast<int>(std::ceil(s.duration_s / kStep));
    double turn = 0;
    for (int i = 0; i < steps; ++i) {
        const double dt = s.duration_s / steps;
        const Motion motion = trajectory.at(begin + (i + 0.5) * dt);
        s.path_m += motion.v_W.norm() * dt;
        turn += (simulation.rig().T_B_C.R.transpose() * motion.omega_B).z() * dt;
    }
    s.turn_deg = std::abs(turn) / kDegree;
}

void add_points(const Simulation& simulation, ExperimentStatistics& s) {
    std::set<FeatureId> ids;
    double observations = 0;
    for (const FeatureFrame& frame : simulation.tracks().frames) {
        observations += static_cast<double>(frame.features.size());
        for (const FeatureObservation& feature : frame.features) ids.insert(feature.feature_id);
    }
    if (ids.empty()) return;
    s.points = static_cast<double>(ids.size());
    s.points_per_image = observations / s.images;
    s.images_per_point = observations / s.points;
}

}  // namespace

void ExperimentStatistics::describe(OptionSet& set) {
    set.section("paper");
    const OptionSet::Range any{0, 1e9};
    set.add("images", &images, "-", any, "images; this and those below as stated, 0: not stated");
    set.add("imu_readings", &imu_readings, "-", any, "inertial readings");
    set.add("duration", &duration_s, "s", any, "from the first to the last image");
    set.add("path", &path_m, "m", any, "distance travelled");
    set.add("turn", &turn_deg, "deg", any, "rotation about the optical axis");
    set.add("points", &points, "-", any, "points in all");
    set.add("points_per_image", &points_per_image, "-", any, "mean points in an image");
    set.add("images_per_point", &images_per_point, "-", any, "mean images that show a point");
}

ExperimentStatistics statistics_of(const Simulation& simulation) {
    ExperimentStatistics s;
    const auto& times = simulation.image_times();
    s.images = static_cast<double>(times.size());
    s.imu_readings = static_cast<double>(simulation.imu().size());
    s.duration_s = to_seconds(times.back() - times.front());
    add_path(simulation, s);
    if (simulation.options().tracks) add_points(simulation, s);
    return s;
}

ClosingError closing_error(const Simulation& simulation) {
    const auto& times = simulation.image_times();
    const TimeNs offset =
        simulation.stamp(simulation.options().time_offset_s) - simulation.stamp(0);
    const auto motion_at = [&](TimeNs t) {
        return moved_to(simulation.trajectory().at(simulation.seconds(t)), simulation.rig().T_B_I);
    };
    const Motion first = motion_at(times.front()), last = motion_at(times.back());
    const ImuSequence imu(simulation.ideal_imu());
    InertialState state{first.T_W_B.R, first.T_W_B.p, first.v_W};
    for (size_t i = 1; i < times.size(); ++i) {
        const auto segments = imu.segments(times[i - 1] + offset, times[i] + offset);
        if (!segments) throw InputError("scenario [imu] margin: readings do not cover the images");
        for (const ImuSegment& segment : *segments) integrate(state, segment, simulation.g_W());
    }
    return {(state.p - last.T_W_B.p).norm(), so3::log(last.T_W_B.R.transpose() * state.R).norm()};
}

std::vector<ComparedStatistic> compared(const ExperimentStatistics& paper,
                                        const ExperimentStatistics& simulated) {
    std::vector<ComparedStatistic> rows{
        {"images", "", paper.images, simulated.images, 0},
        {"inertial readings", "", paper.imu_readings, simulated.imu_readings, 0},
        {"duration", "s", paper.duration_s, simulated.duration_s, 1},
        {"path", "m", paper.path_m, simulated.path_m, 1},
        {"rotation about the optical axis", "deg", paper.turn_deg, simulated.turn_deg, 0}};
    if (simulated.points > 0 || paper.points > 0) {
        rows.push_back({"points in all", "", paper.points, simulated.points, 0});
        rows.push_back(
            {"points in an image", "", paper.points_per_image, simulated.points_per_image, 1});
        rows.push_back({"images that show a point", "", paper.images_per_point,
                        simulated.images_per_point, 1});
    }
    return rows;
}

std::string statistics_table(const Simulation& simulation) {
    const ScenarioOptions& options = simulation.options();
    std::string table =
        "| " + options.name + " | paper | simulated | deviation |\n" + "|---|---:|---:|---:|\n";
    for (const ComparedStatistic& row : compared(options.paper, statistics_of(simulation))) {
        const std::string unit = row.unit.empty() ? "" : " [" + row.unit + "]";
        table += "| " + row.name + unit + " | " +
                 (row.paper > 0 ? text("%.*f", row.paper, row.decimals) : "-") + " | " +
                 text("%.*f", row.simulated, row.decimals) + " | " +
                 (row.paper > 0 ? text("%+.*f %%", 100 * row.deviation(), 1) : "") + " |\n";
    }
    const ClosingError closing = closing_error(simulation);
    return table + "| noise-free readings integrated open loop: error at the end | | " +
           text("%.*e m, ", closing.position_m, 0) + text("%.*e rad", closing.rotation_rad, 0) +
           " | |\n";
}

}  // namespace vio
