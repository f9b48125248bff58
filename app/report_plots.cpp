#include "app/report_plots.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>

#include "app/report_innovations.h"
#include "libvio/base/angles.h"

namespace vio::app {
namespace {

constexpr double kSigmas = 3;
constexpr const char* kAxes[] = {"x", "y", "z"};

Series path(const std::string& name, int colour, const std::vector<TimedPose>& poses, int a,
            int b) {
    Series series;
    series.name = name;
    series.colour = colour;
    for (const TimedPose& row : poses) {
        series.x.push_back(row.T_W_B.p[a]);
        series.y.push_back(row.T_W_B.p[b]);
    }
    return series;
}

// A reference in the estimate's world, while there are estimates.
std::vector<TimedPose> in_world(const Material& m, size_t reference) {
    std::vector<TimedPose> rows;
    const Similarity S_E_G = m.evaluations[reference].alignment.S_G_E.inverse();
    for (const TimedPose& row : apply(S_E_G, m.references[reference].poses))
        if (row.t >= m.start() && row.t <= m.estimate.states.back().t) rows.push_back(row);
    return rows;
}

}  // namespace

std::vector<Plot> path_plots(const Material& m) {
    std::vector<Plot> plots;
    const int views[][2] = {{0, 1}, {0, 2}};
    const char* titles[] = {"From above", "From the side"};
    const int colours[] = {5, 2, 4, 3};
    const std::string unit = m.estimate.has_scale ? " [m]" : " (scale unknown)";
    for (int v = 0; v < 2; ++v) {
        Plot plot;
        plot.title = titles[v];
        plot.x_label = kAxes[views[v][0]] + unit, plot.y_label = kAxes[views[v][1]] + unit;
        plot.equal_axes = true;
        plot.height = 460;
        for (size_t i = 0; i < m.references.size(); ++i) {
            Series series = path(std::filesystem::path(m.references[i].name).filename(),
                                 colours[i % 4], in_world(m, i), views[v][0], views[v][1]);
            if (m.references[i].has_attitude)
                series.style = Series::kDashed;
            else
                series.style = Series::kPoints;
            plot.series.push_back(series);
        }
        plot.series.push_back(path("estimate", 1, m.judged.poses, views[v][0], views[v][1]));
        plots.push_back(plot);
    }
    return plots;
}

std::vector<Plot> error_plots(const Material& m) {
    if (m.references.empty() || !m.judged.covariances) return {};
    const Reference& reference = m.references.front();
    const Evaluation& e = m.evaluations.front();
    if (!reference.has_attitude) return {};
    std::vector<Plot> plots;
    auto pairs = associate(m.judged.poses, reference.poses, from_seconds(e.max_gap_s),
                           from_seconds(e.time_offset_s));
    const Pose T_T_B = reference.T_B_T.inverse();
    for (PosePair& pair : pairs) pair.truth = pair.truth * T_T_B;
    const Similarity S_E_G =
        align_yaw_position(pairs.front().estimate, pairs.front().truth).inverse();
    for (const bool rotation : {false, true})
        for (int axis = 0; axis < 3; ++axis) {
            Plot plot;
            const double unit = rotation ? 1 / kDegree : 1;
            plot.y_label = std::string(rotation ? "rotation " : "position ") + kAxes[axis] +
                           (rotation ? " [deg]" : " [m]");
            plot.x_label = "time [s]";
            plot.height = 230;
            Series band, error;
            band.style = Series::kBand;
            band.name = "3 sigma", error.name = "error";
            error.colour = 6, band.colour = 1;
            const int row = (rotation ? 0 : 3) + axis;
            for (const PosePair& pair : pairs) {
                const Vector6d d = pair.estimate.boxminus(S_E_G * pair.truth);
                const auto idx = static_cast<size_t>(pair.estimate_idx);
                const double sigma =
                    std::sqrt(std::max(0.0, (*m.judged.covariances)[idx](row, row)));
                for (Series* s : {&band, &error}) s->x.push_back(m.seconds(pair.t));
                error.y.push_back(unit * d[row]);
                band.y.push_back(-kSigmas * unit * sigma);
                band.y2.push_back(kSigmas * unit * sigma);
            }
            plot.series = {band, error};
            plots.push_back(plot);
        }
    return plots;
}

std::vector<Plot> error_size_plots(const Material& m) {
    std::vector<Plot> plots;
    const int colours[] = {1, 2, 4, 3};
    for (const bool rotation : {false, true}) {
        Plot plot;
        plot.x_label = "time [s]";
        plot.y_label = rotation ? "rotation error [deg]" : "position error [m]";
        plot.height = 230;
        for (size_t i = 0; i < m.evaluations.size(); ++i) {
            const Evaluation& e = m.evaluations[i];
            if (rotation && !e.has_rotation) continue;
            Series series;
            series.name = std::filesystem::path(e.truth_name).filename();
            series.colour = colours[i % 4];
            for (const PoseError& error : e.errors) {
                series.x.push_back(m.seconds(error.t - from_seconds(e.time_offset_s)));
                series.y.push_back(rotation ? error.rotation / kDegree : error.position.norm());
            }
            plot.series.push_back(series);
        }
        if (!plot.series.empty()) plots.push_back(plot);
    }
    return plots;
}

namespace {

// A vector of the state with its 3-sigma bands, one colour for each axis.
Plot state_plot(const Material& m, const std::string& label,
                const std::function<Eigen::Vector3d(const StateEstimate&)>& value, int covariance,
                double unit) {
    Plot plot;
    plot.x_label = "time [s]", plot.y_label = label;
    plot.height = 260;
    for (int axis = 0; axis < 3; ++axis) {
        Series band, line;
        band.style = Series::kBand;
        line.name = kAxes[axis];
        band.colour = line.colour = axis + 1;
        for (const StateEstimate& s : m.estimate.states) {
            const double sigma =
                std::sqrt(std::max(0.0, s.covariance(covariance + axis, covariance + axis)));
            for (Series* series : {&band, &line}) series->x.push_back(m.seconds(s.t));
            line.y.push_back(unit * value(s)[axis]);
            band.y.push_back(unit * (value(s)[axis] - kSigmas * sigma));
            band.y2.push_back(unit * (value(s)[axis] + kSigmas * sigma));
        }
        plot.series.push_back(band);
        plot.series.push_back(line);
    }
    return plot;
}

}  // namespace

std::vector<Plot> state_plots(const Material& m) {
    if (!m.estimate.has_scale) return {};
    return {state_plot(
                m, "velocity [m/s]", [](const StateEstimate& s) { return s.v_W; }, kVelocity, 1),
            state_plot(
                m, "gyro bias [deg/s]", [](const StateEstimate& s) { return s.gyro_bias; },
                kGyroBias, 1 / kDegree),
            state_plot(
                m, "accelerometer bias [m/s^2]",
                [](const StateEstimate& s) { return s.accel_bias; }, kAccelBias, 1)};
}

Plot feature_plot(const Material& m) {
    Plot features;
    features.x_label = "time [s]", features.y_label = "features used in an image";
    features.height = 260;
    Series used, lost;
    used.name = "features";
    lost.name = "track lost";
    lost.colour = 6;
    lost.style = Series::kPoints;
    for (const StateEstimate& s : m.estimate.states) {
        used.x.push_back(m.seconds(s.t));
        used.y.push_back(s.features);
        if (!s.lost) continue;
        lost.x.push_back(m.seconds(s.t));
        lost.y.push_back(s.features);
    }
    features.series = {used, refused_points(m.estimate), lost};
    return features;
}

}  // namespace vio::app
