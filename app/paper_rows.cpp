#include "app/paper_rows.h"

#include <cmath>

#include "app/comparison.h"
#include "libvio/base/errors.h"

namespace vio::app {
namespace {

std::string pair_text(double mean, double max, int digits) {
    return fixed(mean, digits) + " / " + fixed(max, digits);
}

std::string paper_pair(double mean, double max, int digits) {
    if (mean == kNone) return "N/A";
    return max == kNone ? fixed(mean, digits) : pair_text(mean, max, digits);
}

// As many digits as the paper's figures have, more for figures that these would round away.
int digits_for(double value, int usual) {
    if (value <= 0) return usual;
    return std::max(usual, static_cast<int>(std::ceil(-std::log10(value))) + 1);
}

}  // namespace

Comparison::Comparison(std::vector<std::string> labels, bool with_iterations)
    : with_iterations_(with_iterations) {
    table_.header = std::move(labels);
    for (const char* name :
         {"rotation [rad]", "paper", "translation [cm]", "paper", "scale error", "paper"})
        table_.header.push_back(name);
    if (with_iterations)
        for (const char* name : {"iterations", "paper"}) table_.header.push_back(name);
    table_.header.push_back("runs");
    table_.header.push_back("as good");
}

void Comparison::add(const std::vector<std::string>& labels, const Measures& ours,
                     const PaperValues& paper) {
    std::vector<std::string> row = labels;
    const auto add = [&](bool known, const std::string& value, const std::string& of_paper) {
        row.push_back(known ? value : "N/A");
        row.push_back(of_paper);
    };
    const double cm = 100, percent = 100;
    add(ours.any(),
        pair_text(ours.rotation_mean, ours.rotation_max, digits_for(ours.rotation_mean, 3)),
        paper_pair(paper.rotation_mean, paper.rotation_max,
                   paper.rotation_mean > 0 ? digits_for(paper.rotation_mean, 2) : 2));
    add(ours.any(),
        pair_text(cm * ours.position_mean, cm * ours.position_max,
                  digits_for(cm * ours.position_mean, 2)),
        paper_pair(paper.position_mean, paper.position_max,
                   paper.position_mean > 0 ? digits_for(paper.position_mean, 1) : 1));
    add(ours.scale.has_value(), ours.scale ? fixed(percent * *ours.scale_size, 1) + " %" : "",
        paper.scale == kNone ? "N/A" : fixed(paper.scale, 1) + " %");
    if (with_iterations_)
        add(ours.any() && ours.iterations > 0, fixed(ours.iterations, 0),
            paper.iterations == kNone ? "N/A" : fixed(paper.iterations, 0));
    row.push_back(ours.failed == 0 ? std::to_string(ours.runs)
                                   : std::to_string(ours.runs - ours.failed) + " of " +
                                         std::to_string(ours.runs));

    std::string worse;
    const auto judge = [&](const char* name, double value, double of_paper) {
        if (of_paper == kNone || value <= of_paper) return;
        worse += (worse.empty() ? "" : ", ") + std::string(name);
    };
    const bool paper_has = paper.position_mean != kNone;
    if (ours.any()) {
        judge("rotation", ours.rotation_mean, paper.rotation_mean);
        judge("rotation maximum", ours.rotation_max, paper.rotation_max);
        judge("translation", cm * ours.position_mean, paper.position_mean);
        judge("translation maximum", cm * ours.position_max, paper.position_max);
        if (ours.scale && paper.scale != kNone)
            judge("scale", percent * *ours.scale_size, std::abs(paper.scale));
        if (with_iterations_) judge("iterations", ours.iterations, paper.iterations);
    }
    if (ours.failed > 0 && paper_has)
        worse += (worse.empty() ? "" : ", ") + std::to_string(ours.failed) + " failed";
    row.push_back(!paper_has ? "-" : (worse.empty() ? "yes" : "no: " + worse));
    table_.rows.push_back(row);
    if (!paper_has || worse.empty()) return;
    std::string line;
    for (const std::string& label : labels) line += (line.empty() ? "" : ", ") + label;
    worse_.push_back(line + ": " + worse + (ours.message.empty() ? "" : " (" + ours.message + ")"));
}

std::vector<Outcome> outcomes(const CellStore& store, const std::vector<Cell>& cells) {
    std::vector<Outcome> list;
    for (const Cell& cell : cells) list.push_back(store.outcome(cell));
    return list;
}

Paths paths(const Outcome& outcome, int a, int b, const std::string& name, int colour) {
    Paths result;
    result.estimate.name = name;
    result.estimate.colour = colour;
    result.truth.name = "truth";
    result.truth.colour = 5;
    result.truth.style = Series::kDashed;
    if (!outcome.ok) return result;
    ComparisonOptions how;
    how.alignment = "sim3";
    const JudgedResult judged = read_judged(outcome.result);
    const Reference truth = read_reference(outcome.truth);
    const Evaluation e = compare(judged, truth, how);
    const TimeNs start = truth.poses.front().t;
    const auto fill = [&](const std::vector<TimedPose>& poses, Series& series) {
        const auto value = [&](const TimedPose& row, int axis) {
            return axis == 3 ? to_seconds(row.t - start) : row.T_W_B.p[axis];
        };
        for (const TimedPose& row : poses) {
            series.x.push_back(value(row, a));
            series.y.push_back(value(row, b));
        }
    };
    fill(apply(e.alignment.S_G_E, judged.poses), result.estimate);
    fill(truth.poses, result.truth);
    result.ok = true;
    return result;
}

std::string scenario(const PaperSetup& setup, const std::string& name, int seed,
                     const std::string& arguments) {
    return "\"" + setup.datasets + "/" + name +
           ".ini\" --set images.render=false --set scenario.seed=" + std::to_string(seed) +
           (arguments.empty() ? "" : " " + arguments);
}

std::string paper_batch(const std::string& variance, const std::string& arguments) {
    return "--estimator batch --set batch.sigma_px=2 --set batch.weighting=fixed"
           " --set batch.fixed_variance=" +
           variance +
           " --set batch.gravity=free --set batch.bias=constant --set batch.loss=none"
           " --set batch.max_iterations=500" +
           (arguments.empty() ? "" : " " + arguments);
}

std::string paper_filter(const std::string& rate_variance, const std::string& accel_variance,
                         int prefix) {
    return "--estimator iekf --set iekf.motion=smooth --set iekf.angular_rate_variance=" +
           rate_variance + " --set iekf.acceleration_variance=" + accel_variance +
           " --set iekf.sigma_px=2 --set batch.sigma_px=2 --set iekf.prefix_images=" +
           std::to_string(prefix);
}

std::string own_filter(int prefix) {
    return "--estimator iekf --set iekf.sigma_px=2 --set batch.sigma_px=2"
           " --set iekf.prefix_images=" +
           std::to_string(prefix);
}

const std::vector<Exhibit>& exhibits() {
    static const std::vector<Exhibit> all = [] {
        std::vector<Exhibit> list = arm_exhibits();
        for (const Exhibit& exhibit : other_exhibits()) list.push_back(exhibit);
        return list;
    }();
    return all;
}

}  // namespace vio::app
