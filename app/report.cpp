// vio-slam report: one page on one result, to be read by people.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "app/commands.h"
#include "app/comparison.h"
#include "app/measures.h"
#include "app/page.h"
#include "app/plot.h"
#include "app/report.h"
#include "libvio/base/errors.h"
#include "libvio/io/results.h"
#include "libvio/io/text.h"
#include "libvio/io/trajectory_io.h"

namespace vio::app {
namespace {

constexpr double kDegrees = 180 / M_PI;
constexpr double kSigmas = 3;
constexpr const char* kAxes[] = {"x", "y", "z"};

// A result with what it is compared with.
struct Material {
    std::string folder;
    Estimate estimate;
    JudgedResult judged;
    nlohmann::json summary;
    std::vector<Reference> references;
    std::vector<Evaluation> evaluations;

    TimeNs start() const { return estimate.states.front().t; }
    double seconds(TimeNs t) const { return to_seconds(t - start()); }
};

std::string known(const nlohmann::json& json, const char* key, int digits) {
    return json.contains(key) && json[key].is_number() ? fixed(json[key].get<double>(), digits)
                                                       : "-";
}

void add_summary(const Material& m, Page& page) {
    const nlohmann::json& s = m.summary;
    Table table;
    table.header = {"run", ""};
    const auto text = [&](const char* name, const char* key) {
        if (s.contains(key) && s[key].is_string() && !s[key].get<std::string>().empty())
            table.rows.push_back({name, s[key].get<std::string>()});
    };
    text("recording", "rawlog");
    text("estimator", "estimator");
    text("sensors", "sensors");
    text("outcome", "estimator_report");
    const std::string all = known(s, "images_in_recording", 0);
    table.rows.push_back(
        {"images with a pose", std::to_string(m.estimate.states.size()) + " of " + all});
    table.rows.push_back({"of these, track lost", known(s, "lost_poses", 0)});
    table.rows.push_back({"duration [s]", known(s, "duration_s", 2)});
    table.rows.push_back(
        {m.estimate.has_scale ? "path [m]" : "path (scale unknown)", known(s, "path_length_m", 2)});
    table.rows.push_back({"landmarks", known(s, "landmarks", 0)});
    table.rows.push_back({"IMU readings", known(s, "imu_readings", 0)});
    table.rows.push_back({"time: tracking [s]", known(s, "tracking_s", 2)});
    table.rows.push_back({"time: estimation [s]", known(s, "estimation_s", 2)});
    table.rows.push_back({"time: input and output [s]", known(s, "input_output_s", 2)});
    table.rows.push_back({"times real time", known(s, "real_time_ratio", 1)});
    page.table(table);
}

void add_events(const Material& m, Page& page) {
    Table table;
    table.header = {"time [s]", "event or warning"};
    for (const auto& event : m.summary.value("events", nlohmann::json::array()))
        table.rows.push_back(
            {fixed(m.seconds(event.value("t_ns", m.start())), 2), event.value("text", "")});
    if (m.summary.contains("damage"))
        table.rows.push_back({"", m.summary["damage"].get<std::string>()});
    if (!m.summary.value("converged", true)) table.rows.push_back({"", "has not converged"});
    for (const Evaluation& e : m.evaluations)
        for (const std::string& warning : e.warnings)
            table.rows.push_back({"", e.truth_name + ": " + warning});
    if (table.rows.empty()) return;
    page.heading("Events and warnings");
    page.table(table);
}

void add_comparisons(const Material& m, Page& page) {
    if (m.evaluations.empty()) return;
    page.heading("Compared with the truth");
    Table table;
    table.header = {
        "against",          "alignment",           "poses",         "path [m]", "position RMSE [m]",
        "position max [m]", "rotation RMSE [deg]", "scale error %", "drift %",  "NEES pose (6)"};
    for (const Evaluation& e : m.evaluations)
        table.rows.push_back({e.truth_name, to_string(e.alignment.kind),
                              std::to_string(e.associated_poses), fixed(e.truth_path_length, 2),
                              fixed(e.position.rmse, 4), fixed(e.position.max, 4),
                              e.has_rotation ? fixed(kDegrees * e.rotation.rmse, 3) : "-",
                              e.scale_error ? fixed(100 * *e.scale_error, 2) : "-",
                              e.drift ? fixed(100 * e.drift->translation, 3) : "-",
                              e.nees ? fixed(e.nees->pose.mean, 2) : "-"});
    page.table(table);
    for (const Evaluation& e : m.evaluations)
        page.folded("All figures against " + e.truth_name, to_text(e));
}

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

void add_paths(const Material& m, std::vector<Plot>& plots) {
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
}

// Errors of position (world axes) or rotation (body axes) with their 3-sigma bands. The worlds are
// brought together at the first pose, as for the NEES: there the covariance is expressed.
void add_errors(const Material& m, std::vector<Plot>& plots) {
    if (m.references.empty() || !m.judged.covariances) return;
    const Reference& reference = m.references.front();
    const Evaluation& e = m.evaluations.front();
    if (!reference.has_attitude) return;
    auto pairs = associate(m.judged.poses, reference.poses, from_seconds(e.max_gap_s),
                           from_seconds(e.time_offset_s));
    const Pose T_T_B = reference.T_B_T.inverse();
    for (PosePair& pair : pairs) pair.truth = pair.truth * T_T_B;
    const Similarity S_E_G =
        align_yaw_position(pairs.front().estimate, pairs.front().truth).inverse();
    for (const bool rotation : {false, true})
        for (int axis = 0; axis < 3; ++axis) {
            Plot plot;
            const double unit = rotation ? kDegrees : 1;
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
}

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

void add_states(const Material& m, std::vector<Plot>& plots) {
    if (m.estimate.has_scale) {
        plots.push_back(state_plot(
            m, "velocity [m/s]", [](const StateEstimate& s) { return s.v_W; }, kVelocity, 1));
        plots.push_back(state_plot(
            m, "gyro bias [deg/s]", [](const StateEstimate& s) { return s.gyro_bias; }, kGyroBias,
            kDegrees));
        plots.push_back(state_plot(
            m, "accelerometer bias [m/s^2]", [](const StateEstimate& s) { return s.accel_bias; },
            kAccelBias, 1));
    }
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
    features.series = {used, lost};
    plots.push_back(features);
}

std::string gravity_text(const Estimate& estimate) {
    const Eigen::Vector3d sigma = estimate.gravity_covariance.diagonal().cwiseMax(0).cwiseSqrt();
    std::string text = "Gravity in the world frame [m/s^2]:";
    for (int k = 0; k < 3; ++k)
        text += " " + fixed(estimate.g_W[k], 4) +
                (sigma.isZero() ? "" : " (sigma " + fixed(sigma[k], 4) + ")") + (k < 2 ? "," : "");
    return text + ", of length " + fixed(estimate.g_W.norm(), 4) + ".";
}

Material read_material(const std::string& folder, const ComparisonOptions& comparison) {
    Material m;
    if (!std::filesystem::is_directory(folder))
        throw InputError(folder + ": is no results folder; see vio-slam run");
    m.folder = folder;
    m.estimate = read_results(folder);
    m.judged = read_judged(folder);
    m.summary = nlohmann::json::parse(read_text(folder + "/summary.json"), nullptr, false);
    if (!m.summary.is_object())
        throw InputError(folder + "/summary.json: is missing or damaged; run again");
    m.references = read_references(comparison);
    for (const Reference& reference : m.references)
        m.evaluations.push_back(compare(m.judged, reference, comparison));
    return m;
}

// Draws all plots at once and deals them out to the sections that they belong to.
void add_plots(const Material& m, Page& page) {
    std::vector<Plot> paths, errors, states;
    add_paths(m, paths);
    add_errors(m, errors);
    add_states(m, states);
    std::vector<Plot> all = paths;
    for (const auto* more : {&errors, &states}) all.insert(all.end(), more->begin(), more->end());
    const std::vector<std::string> drawn = draw(all);
    auto next = drawn.begin();
    const auto deal = [&](const std::string& heading, const std::string& name, size_t count,
                          const std::string& caption) {
        if (count == 0) return;
        if (!heading.empty()) page.heading(heading);
        const auto end = next + static_cast<std::ptrdiff_t>(count);
        page.plots(name, {next, end}, caption);
        next = end;
    };
    deal("Path", "path", paths.size(),
         m.references.empty() ? "In the estimate's world."
                              : "In the estimate's world; the others are aligned to it.");
    const std::string picture = m.folder + "/snapshot.png";
    if (std::filesystem::exists(picture))
        page.picture(picture, "Path, cameras, landmarks and 3-sigma ellipsoids.");
    deal("Errors over time", "errors", errors.size(),
         "Estimate minus " + (m.references.empty() ? "" : m.references.front().name) +
             ", the worlds brought together at the first pose by yaw and position, where the "
             "covariance is expressed. Errors leave the band 0.3 % of the time if the covariance "
             "is right.");
    deal("States", "states", states.size(),
         m.estimate.has_scale ? "Bands: 3 sigma. " + gravity_text(m.estimate) : "");
}

struct Arguments {
    std::string result, output;
    ComparisonOptions comparison;
};

void run(const Arguments& arguments) {
    const std::string file = write_report(arguments.result, arguments.comparison, arguments.output);
    std::cout << "report      " << file << "\n";
}

}  // namespace

std::string write_report(const std::string& folder, const ComparisonOptions& comparison,
                         const std::string& output) {
    const Material m = read_material(folder, comparison);
    Page page("Motion estimate: " + std::filesystem::path(folder).lexically_normal().string());
    add_summary(m, page);
    add_events(m, page);
    add_comparisons(m, page);
    add_plots(m, page);
    if (std::filesystem::exists(folder + "/options.ini"))
        page.folded("Options as used", read_text(folder + "/options.ini"));
    std::string stem = output.empty() ? folder + "/report.html" : output;
    if (stem.ends_with(".html")) stem.resize(stem.size() - 5);
    page.write(stem, /*with_markdown=*/false);
    return stem + ".html";
}

void add_report(CLI::App& program) {
    CLI::App* command = program.add_subcommand(
        "report", "One self-contained HTML page on a result: paths, errors, states, options");
    auto arguments = std::make_shared<Arguments>();
    command->add_option("RESULT", arguments->result, "Results folder")->required();
    command->add_option("-o,--output", arguments->output,
                        "File to write; default: report.html in the results folder");
    add_options(*command, arguments->comparison, /*against_required=*/false);
    command->callback([arguments] { run(*arguments); });
}

}  // namespace vio::app
