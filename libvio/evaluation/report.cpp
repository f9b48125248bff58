// Evaluation as text and as JSON.
#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "libvio/base/angles.h"
#include "libvio/evaluation/evaluate.h"

namespace vio {
namespace {

using Json = nlohmann::ordered_json;

[[gnu::format(printf, 2, 3)]] void append(std::string& text, const char* format, ...) {
    char line[512];
    va_list arguments;
    va_start(arguments, format);
    std::vsnprintf(line, sizeof(line), format, arguments);
    va_end(arguments);
    text += line;
}

void append_statistics(std::string& text, const char* name, const char* unit,
                       const ErrorStatistics& s, double factor) {
    append(text, "  %-16s %9.4f %9.4f %9.4f %9.4f  %s\n", name, factor * s.mean, factor * s.rmse,
           factor * s.median, factor * s.max, unit);
}

void append_steps(std::string& text, const std::vector<RelativeError>& steps, const char* unit) {
    for (const RelativeError& r : steps) {
        if (r.translation.count == 0) {
            append(text, "  over %-8.3g %-3s no pair of poses that far apart\n", r.step, unit);
            continue;
        }
        char name[32];
        std::snprintf(name, sizeof(name), "over %.3g %s", r.step, unit);
        append_statistics(text, name, "m", r.translation, 1);
        append_statistics(text, "", "deg", r.rotation, 1 / kDegree);
    }
}

void append_nees(std::string& text, const char* name, const NeesStatistics& s) {
    append(text, "  %-16s %9.2f (expected %d), %.1f %% inside 95 %%  [%d poses]\n", name, s.mean,
           s.dof, 100 * s.share_in_95, s.count);
}

Json statistics_json(const ErrorStatistics& s, double factor) {
    return {{"mean", factor * s.mean},   {"rmse", factor * s.rmse}, {"median", factor * s.median},
            {"std", factor * s.std_dev}, {"min", factor * s.min},   {"max", factor * s.max},
            {"count", s.count}};
}

Json steps_json(const std::vector<RelativeError>& steps, const char* step_name) {
    Json list = Json::array();
    for (const RelativeError& r : steps)
        list.push_back({{step_name, r.step},
                        {"translation_m", statistics_json(r.translation, 1)},
                        {"rotation_deg", statistics_json(r.rotation, 1 / kDegree)}});
    return list;
}

Json nees_json(const NeesStatistics& s) {
    return {{"mean", s.mean}, {"dof", s.dof}, {"share_in_95", s.share_in_95}, {"count", s.count}};
}

Json matrix_json(const Eigen::Matrix3d& R) {
    Json rows = Json::array();
    for (int i = 0; i < 3; ++i) rows.push_back({R(i, 0), R(i, 1), R(i, 2)});
    return rows;
}

}  // namespace

std::string to_text(const Evaluation& e) {
    std::string text;
    append(text, "%s against %s\n", e.estimate_name.c_str(), e.truth_name.c_str());
    append(text, "  alignment        %s\n", to_string(e.alignment.kind).c_str());
    if (e.time_offset_estimated || e.time_offset_s != 0)
        append(text, "  time offset      %+.6f s (%s)\n", e.time_offset_s,
               e.time_offset_estimated ? "estimated" : "as given");
    append(text,
           "  poses            %d of %d with truth, over %.2f s and %.2f m (estimate %.2f m)\n",
           e.associated_poses, e.estimated_poses, e.duration_s, e.truth_path_length,
           e.estimate_path_length);
    if (e.completion.expected > 0)
        append(text, "  completion       %.1f %% (%d of %d images)\n", 100 * e.completion.share(),
               e.completion.estimated, e.completion.expected);
    if (e.scale_error)
        append(text, "  scale error      %+.3f %%\n", 100 * *e.scale_error);
    else
        append(text, "  scale error      undetermined by this path\n");
    append(text, "\n  %-16s %9s %9s %9s %9s\n", "absolute error", "average", "RMSE", "median",
           "maximum");
    append_statistics(text, "position", "m", e.position, 1);
    if (e.has_rotation)
        append_statistics(text, "rotation", "deg", e.rotation, 1 / kDegree);
    else
        append(text, "  %-16s the truth has no attitude\n", "rotation");
    if (e.after_start) {
        append(text, "\n  the %d poses after the start's %d (a batch over the first images)\n",
               e.after_start->poses, e.after_start->start_poses);
        append_statistics(text, "position", "m", e.after_start->position, 1);
        if (e.has_rotation)
            append_statistics(text, "rotation", "deg", e.after_start->rotation, 1 / kDegree);
    }
    if (!e.rpe_distance.empty() || !e.rpe_time.empty()) {
        append(text, "\n  relative error\n");
        append_steps(text, e.rpe_distance, "m");
        append_steps(text, e.rpe_time, "s");
    }
    if (e.drift)
        append(text, "  %-16s %.3f %% of the distance, %.4f deg/m\n", "drift",
               100 * e.drift->translation, e.drift->rotation / kDegree);
    if (e.nees) {
        append(text,
               "\n  NEES (yaw and position aligned at the first pose, the truth taken as exact)\n");
        append_nees(text, "position", e.nees->position);
        append_nees(text, "rotation", e.nees->rotation);
        append_nees(text, "pose", e.nees->pose);
    }
    if (!e.no_nees.empty()) append(text, "\n  NEES             left out: %s\n", e.no_nees.c_str());
    for (const std::string& warning : e.warnings) append(text, "\n  note: %s", warning.c_str());
    if (!e.warnings.empty()) text += '\n';
    return text;
}

std::string to_table(const std::vector<Evaluation>& evaluations) {
    size_t names = 8, truths = 5;
    for (const Evaluation& e : evaluations) {
        names = std::max(names, e.estimate_name.size());
        truths = std::max(truths, e.truth_name.size());
    }
    std::string text;
    const int n = static_cast<int>(names), t = static_cast<int>(truths);
    append(text, "%-*s  %-*s %12s %23s %16s %7s %7s %7s\n", n, "estimate", t, "truth", "",
           "position [m]", "rotation [deg]", "scale", "drift", "compl.");
    append(text, "%-*s  %-*s %5s %6s %7s %7s %7s %7s %8s %7s %7s %7s\n", n, "", t, "", "poses", "m",
           "average", "RMSE", "max.", "average", "max.", "%", "%", "%");
    const auto percent = [&](bool known, double share, const char* format) {
        char value[32] = "-";
        if (known) std::snprintf(value, sizeof(value), format, 100 * share);
        append(text, " %7s", value);
    };
    for (const Evaluation& e : evaluations) {
        append(text, "%-*s  %-*s %5d %6.1f %7.4f %7.4f %7.4f", n, e.estimate_name.c_str(), t,
               e.truth_name.c_str(), e.associated_poses, e.truth_path_length, e.position.mean,
               e.position.rmse, e.position.max);
        if (e.has_rotation)
            append(text, " %7.3f %8.3f", e.rotation.mean / kDegree, e.rotation.max / kDegree);
        else
            append(text, " %7s %8s", "-", "-");
        percent(e.scale_error.has_value(), e.scale_error.value_or(0), "%+.2f");
        percent(e.drift.has_value(), e.drift ? e.drift->translation : 0, "%.3f");
        percent(e.completion.expected > 0, e.completion.share(), "%.1f");
        text += '\n';
    }
    if (!evaluations.empty()) {
        const AlignmentKind kind = evaluations.front().alignment.kind;
        const bool same = std::all_of(evaluations.begin(), evaluations.end(),
                                      [&](const auto& e) { return e.alignment.kind == kind; });
        if (same) append(text, "\nalignment %s\n", to_string(kind).c_str());
        if (!same)
            for (const Evaluation& e : evaluations)
                append(text, "\nalignment %s: %s", to_string(e.alignment.kind).c_str(),
                       e.estimate_name.c_str());
        if (!same) text += '\n';
    }
    for (const Evaluation& e : evaluations)
        for (const std::string& warning : e.warnings)
            append(text, "note: %s against %s: %s\n", e.estimate_name.c_str(), e.truth_name.c_str(),
                   warning.c_str());
    return text;
}

Json to_json(const Evaluation& e) {
    const Similarity& S = e.alignment.S_G_E;
    Json json = {
        {"estimate", e.estimate_name},
        {"truth", e.truth_name},
        {"alignment", to_string(e.alignment.kind)},
        {"alignment_scale", S.s},
        {"alignment_rotation", matrix_json(S.R)},
        {"alignment_translation_m", {S.p.x(), S.p.y(), S.p.z()}},
        {"estimated_poses", e.estimated_poses},
        {"lost_poses", e.lost_poses},
        {"associated_poses", e.associated_poses},
        {"duration_s", e.duration_s},
        {"truth_path_length_m", e.truth_path_length},
        {"estimate_path_length_m", e.estimate_path_length},
        {"position_m", statistics_json(e.position, 1)},
        {"rotation_deg", e.has_rotation ? statistics_json(e.rotation, 1 / kDegree) : Json()},
        {"scale_error", e.scale_error ? Json(*e.scale_error) : Json()},
        {"time_offset_s", e.time_offset_s},
        {"time_offset_estimated", e.time_offset_estimated}};
    if (e.completion.expected > 0)
        json["completion"] = {{"share", e.completion.share()},
                              {"images", e.completion.expected},
                              {"with_pose", e.completion.estimated}};
    if (e.after_start)
        json["after_start"] = {
            {"poses", e.after_start->poses},
            {"start_poses", e.after_start->start_poses},
            {"position_m", statistics_json(e.after_start->position, 1)},
            {"rotation_deg",
             e.has_rotation ? statistics_json(e.after_start->rotation, 1 / kDegree) : Json()}};
    json["relative_over_distance"] = steps_json(e.rpe_distance, "step_m");
    json["relative_over_time"] = steps_json(e.rpe_time, "step_s");
    if (e.drift)
        json["drift"] = {{"translation_share", e.drift->translation},
                         {"rotation_deg_per_m", e.drift->rotation / kDegree}};
    json["truth_gaps"] = Json::array();
    for (const TruthGap& gap : e.gaps)
        json["truth_gaps"].push_back({{"from_ns", gap.from}, {"to_ns", gap.to}});
    if (e.nees)
        json["nees"] = {{"position", nees_json(e.nees->position)},
                        {"rotation", nees_json(e.nees->rotation)},
                        {"pose", nees_json(e.nees->pose)}};
    if (!e.no_nees.empty()) json["nees_left_out"] = e.no_nees;
    json["warnings"] = e.warnings;
    return json;
}

}  // namespace vio
