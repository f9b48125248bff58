// vio-slam report: one page on one result, to be read by people.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "app/commands.h"
#include "app/measures.h"
#include "app/page.h"
#include "app/report.h"
#include "app/report_innovations.h"
#include "app/report_plots.h"
#include "libvio/base/angles.h"
#include "libvio/base/errors.h"
#include "libvio/base/files.h"
#include "libvio/io/results.h"
#include "libvio/io/text.h"
#include "libvio/io/trajectory_io.h"

namespace vio::app {
namespace {

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
    table.rows.push_back({"images with a pose", known(s, "images", 0) + " of " + all});
    table.rows.push_back({"of these, track lost", known(s, "lost_poses", 0)});
    table.rows.push_back({"duration [s]", known(s, "duration_s", 2)});
    table.rows.push_back(
        {m.estimate.has_scale ? "path [m]" : "path (scale unknown)", known(s, "path_length_m", 2)});
    table.rows.push_back({"landmarks", known(s, "landmarks", 0)});
    table.rows.push_back({"IMU readings", known(s, "imu_readings", 0)});
    page.table(table);
}

void add_timing(const Material& m, Page& page) {
    Table table;
    table.header = {"step", "time [s]", "an image [ms]"};
    const double images = m.summary.value("images_in_recording", 0);
    for (const auto& [name, key] : {std::pair{"tracking", "tracking_s"},
                                    {"estimation", "estimation_s"},
                                    {"input and output", "input_output_s"}}) {
        const double seconds = m.summary.value(key, 0.0);
        table.rows.push_back(
            {name, known(m.summary, key, 2), images > 0 ? fixed(1e3 * seconds / images, 2) : "-"});
    }
    page.heading("Timing");
    page.table(table);
    page.text("Tracking and estimation together: " + known(m.summary, "real_time_ratio", 1) +
              " times as fast as the recording.");
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
    const std::string innovations = innovation_warning(m.estimate);
    if (!innovations.empty()) table.rows.push_back({"", innovations});
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
                              e.has_rotation ? fixed(e.rotation.rmse / kDegree, 3) : "-",
                              e.scale_error ? fixed(100 * *e.scale_error, 2) : "-",
                              e.drift ? fixed(100 * e.drift->translation, 3) : "-",
                              e.nees ? fixed(e.nees->pose.mean, 2) : "-"});
    page.table(table);
    for (const Evaluation& e : m.evaluations)
        page.folded("All figures against " + e.truth_name, to_text(e));
}

// The parameters at the end, each with its standard deviation.
Table parameters(const Estimate& estimate) {
    Table table;
    if (!estimate.has_scale) return table;
    table.header = {"at the end", "x", "y", "z", "length", "sigma x", "sigma y", "sigma z"};
    const auto add = [&](const char* name, const Eigen::Vector3d& value,
                         const Eigen::Vector3d& variance, double unit) {
        std::vector<std::string> row = {name};
        for (int k = 0; k < 3; ++k) row.push_back(fixed(unit * value[k], 4));
        row.push_back(fixed(unit * value.norm(), 4));
        for (int k = 0; k < 3; ++k)
            row.push_back(
                variance.isZero() ? "-" : fixed(unit * std::sqrt(std::max(0.0, variance[k])), 4));
        table.rows.push_back(row);
    };
    const StateEstimate& last = estimate.states.back();
    const Eigen::Matrix<double, 15, 1> variance = last.covariance.diagonal();
    add("gravity in W [m/s^2]", estimate.g_W, estimate.gravity_covariance.diagonal(), 1);
    add("gyro bias [deg/s]", last.gyro_bias, variance.segment<3>(kGyroBias), 1 / kDegree);
    add("accelerometer bias [m/s^2]", last.accel_bias, variance.segment<3>(kAccelBias), 1);
    return table;
}

Material read_material(const std::string& folder, const ComparisonOptions& comparison) {
    Material m;
    if (!is_folder(folder)) throw InputError(folder + ": is no results folder; see vio-slam run");
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
    std::vector<Plot> paths = path_plots(m), sizes = error_size_plots(m), errors = error_plots(m),
                      states = state_plots(m), features = {feature_plot(m)};
    std::vector<Plot> innovations = innovation_plots(m.estimate);
    std::vector<Plot> all = paths;
    for (const auto* more : {&sizes, &errors, &states, &features, &innovations})
        all.insert(all.end(), more->begin(), more->end());
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
    if (is_there(picture))
        page.picture(picture, "Path, cameras, landmarks and 3-sigma ellipsoids.");
    deal("Errors over time", "error_sizes", sizes.size(), "After the alignment.");
    deal("", "errors", errors.size(),
         "Estimate minus " + (m.references.empty() ? "" : m.references.front().name) +
             ", the worlds brought together at the first pose by yaw and position, where the "
             "covariance is expressed. Errors leave the band 0.3 % of the time if the covariance "
             "is right.");
    deal("Velocity, biases and gravity", "states", states.size(), "Bands: 3 sigma.");
    if (const Table table = parameters(m.estimate); !table.rows.empty()) page.table(table);
    deal(
        "Features and innovations", "innovations", features.size() + innovations.size(),
        innovations.empty()
            ? ""
            : "What each image told the filter beyond what its state expected, normalised by the "
              "covariance that it claims and in pixels. Above the band, which holds 95 % if the "
              "covariance is right: it is too small, or tracks are wrong. Below: the noise that is "
              "stated is larger than what changes from image to image; features that creep err "
              "alike "
              "in many.");
    if (const Table table = innovation_table(m.estimate); !table.rows.empty()) page.table(table);
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
    add_timing(m, page);
    if (is_there(folder + "/options.ini"))
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
