#include "app/paper_rows.h"

#include <algorithm>
#include <cmath>
#include <set>

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

// One of the table's figures.
struct Metric {
    const char* name;
    double PaperValues::*paper;
    double (*ours)(const Measures&);  // in the paper's unit; NaN: there is none
    int digits;
    const char* unit;
};
const Metric kMetrics[] = {
    {"rotation", &PaperValues::rotation_mean, [](const Measures& m) { return m.rotation_mean; }, 3,
     " rad"},
    {"rotation maximum", &PaperValues::rotation_max,
     [](const Measures& m) { return m.rotation_max; }, 3, " rad"},
    {"translation", &PaperValues::position_mean,
     [](const Measures& m) { return 100 * m.position_mean; }, 1, " cm"},
    {"translation maximum", &PaperValues::position_max,
     [](const Measures& m) { return 100 * m.position_max; }, 1, " cm"},
    {"scale", &PaperValues::scale,
     [](const Measures& m) { return m.scale_size ? 100 * *m.scale_size : NAN; }, 1, " %"},
    {"iterations", &PaperValues::iterations, [](const Measures& m) { return m.iterations; }, 0, ""},
};
const Metric& kIterations = kMetrics[std::size(kMetrics) - 1];

bool as_good(const Metric& metric, const Measures& ours, const PaperValues& paper) {
    const double of_paper = paper.*metric.paper;
    return of_paper == kNone || !(metric.ours(ours) > std::abs(of_paper));
}

std::vector<const Metric*> worse_metrics(const Measures& ours, const PaperValues& paper,
                                         bool with_iterations) {
    std::vector<const Metric*> list;
    if (!ours.any()) return list;
    for (const Metric& metric : kMetrics)
        if (!as_good(metric, ours, paper) && (with_iterations || &metric != &kIterations))
            list.push_back(&metric);
    return list;
}

// "translation 2.6 cm (1.2 to 4.1; 3 of 5 as good)": mean, and single recordings.
std::string spread_text(const Metric& metric, const std::vector<Outcome>& outcomes,
                        const PaperValues& paper) {
    double least = INFINITY, most = -INFINITY;
    int good = 0, all = 0;
    for (const Outcome& outcome : outcomes) {
        const Measures single = measure({outcome});
        const double value = metric.ours(single);
        if (!single.any() || !std::isfinite(value)) continue;
        least = std::min(least, value), most = std::max(most, value);
        good += as_good(metric, single, paper);
        ++all;
    }
    const std::string text = std::string(metric.name) + " " +
                             fixed(metric.ours(measure(outcomes)), metric.digits) + metric.unit;
    if (all < 2) return text;
    return text + " (single recordings " + fixed(least, metric.digits) + " to " +
           fixed(most, metric.digits) + ", " + std::to_string(good) + " of " + std::to_string(all) +
           " as good)";
}

std::string joined(const std::vector<std::string>& parts, const char* between = ", ") {
    std::string text;
    for (const std::string& part : parts) text += (text.empty() ? "" : between) + part;
    return text;
}

// What other estimates reach from the same recordings, and so what the recordings allow.
std::string comparison_text(const std::vector<const Metric*>& errors, const PaperValues& paper,
                            const Reasons& reasons) {
    std::vector<std::string> reached;
    std::set<const Metric*> allowed;
    for (const Yardstick& yardstick : reasons.yardsticks) {
        const Measures m = measure(yardstick.outcomes);
        if (!m.any()) continue;
        std::vector<std::string> values;
        for (const Metric* metric : errors) {
            values.push_back(std::string(metric->name) + " " +
                             fixed(metric->ours(m), metric->digits) + metric->unit);
            if (as_good(*metric, m, paper)) allowed.insert(metric);
        }
        reached.push_back(yardstick.name + ": " + joined(values));
    }
    if (reached.empty()) return "";
    std::vector<std::string> yes, no;
    for (const Metric* metric : errors) (allowed.count(metric) ? yes : no).push_back(metric->name);
    std::string text = "From the same recordings, " + joined(reached, "; ") + ". ";
    if (!yes.empty())
        text += "So they allow the paper's " + joined(yes) +
                "; what is lost is lost by this estimate" +
                (reasons.cause.empty() ? "" : ": " + reasons.cause);
    if (!no.empty())
        text += (yes.empty() ? "" : ". ") + std::string("No estimate here reaches the paper's ") +
                joined(no) + ", the figure of one recording: these recordings do not tell so much";
    return text;
}

// What the filter itself told of trouble; nothing if it ran through.
std::string trouble_text(const std::vector<Outcome>& outcomes) {
    size_t troubled = 0;
    std::string first;
    for (const Outcome& outcome : outcomes) {
        if (!outcome.summary.is_object()) continue;  // failed
        std::string text;
        for (const auto& event : outcome.summary.value("events", nlohmann::json::array()))
            if (text.empty() && event.value("text", "").rfind("started", 0) != 0)
                text = event.value("text", "");
        troubled += !text.empty();
        if (first.empty()) first = text;
    }
    if (troubled == 0) return "";
    return "The estimator tells of trouble in " + std::to_string(troubled) + " of " +
           std::to_string(outcomes.size()) + ", first: " + first;
}

// Where the figures above the paper's come from: the recordings, or the estimate.
std::string explanation(const std::vector<Outcome>& outcomes,
                        const std::vector<const Metric*>& above, const PaperValues& paper,
                        const Reasons& reasons) {
    std::vector<std::string> sentences, figures;
    const Measures ours = measure(outcomes);
    std::vector<const Metric*> errors;
    for (const Metric* metric : above) {
        figures.push_back(spread_text(*metric, outcomes, paper));
        if (metric != &kIterations) errors.push_back(metric);
    }
    if (!figures.empty()) sentences.push_back(joined(figures));
    if (ours.failed > 0)
        sentences.push_back(std::to_string(ours.failed) + " of " + std::to_string(ours.runs) +
                            " give no estimate: " + ours.message);
    if (!errors.empty())
        for (const std::string& sentence :
             {trouble_text(outcomes), comparison_text(errors, paper, reasons)})
            if (!sentence.empty()) sentences.push_back(sentence);
    const Measures loose = measure(reasons.looser);
    if (errors.size() < above.size() && loose.any())
        sentences.push_back(
            "Iterations are counted until the cost falls by less than 1e-8 of itself; until it "
            "falls by less than " +
            std::string(kLooseTolerance) + " there are " + fixed(loose.iterations, 1) +
            ", with a translation error of " + fixed(100 * loose.position_mean, 2) +
            " cm in place of " + fixed(100 * ours.position_mean, 2) + " cm");
    return joined(sentences, ". ");
}

Evaluation over_all_images(const Outcome& outcome) {
    ComparisonOptions how;
    how.alignment = "sim3";
    return compare(read_judged(outcome.result), read_reference(outcome.truth), how);
}

// Translation error in cm, as "average / maximum" over the images; means over the recordings.
std::string all_images_text(const std::vector<Outcome>& outcomes) {
    double mean = 0, max = 0;
    int count = 0;
    for (const Outcome& outcome : outcomes) {
        if (!outcome.ok) continue;
        const Evaluation e = over_all_images(outcome);
        mean += 100 * e.position.mean, max += 100 * e.position.max;
        ++count;
    }
    if (count == 0) return "N/A";
    return pair_text(mean / count, max / count, digits_for(mean / count, 2));
}

}  // namespace

Comparison::Comparison(std::vector<std::string> labels, bool with_iterations)
    : with_iterations_(with_iterations) {
    table_.header = std::move(labels);
    for (const char* name : {"rotation [rad]", "paper", "translation [cm]", "paper",
                             "translation, all images [cm]", "scale error", "paper"})
        table_.header.push_back(name);
    if (with_iterations)
        for (const char* name : {"iterations", "paper"}) table_.header.push_back(name);
    table_.header.push_back("runs");
    table_.header.push_back("as good");
}

void Comparison::add(const std::vector<std::string>& labels, const std::vector<Outcome>& outcomes,
                     const PaperValues& paper, const Reasons& reasons) {
    const Measures ours = measure(outcomes);
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
    row.push_back(all_images_text(outcomes));
    add(ours.scale.has_value(), ours.scale ? fixed(percent * *ours.scale_size, 1) + " %" : "",
        paper.scale == kNone ? "N/A" : fixed(paper.scale, 1) + " %");
    if (with_iterations_)
        add(ours.any() && ours.iterations > 0, fixed(ours.iterations, 0),
            paper.iterations == kNone ? "N/A" : fixed(paper.iterations, 0));
    row.push_back(ours.failed == 0 ? std::to_string(ours.runs)
                                   : std::to_string(ours.runs - ours.failed) + " of " +
                                         std::to_string(ours.runs));

    const std::vector<const Metric*> above = worse_metrics(ours, paper, with_iterations_);
    std::string worse;
    for (const Metric* metric : above)
        worse += (worse.empty() ? "" : ", ") + std::string(metric->name);
    const bool paper_has = paper.position_mean != kNone;
    if (ours.failed > 0 && paper_has)
        worse += (worse.empty() ? "" : ", ") + std::to_string(ours.failed) + " failed";
    row.push_back(!paper_has ? "-" : (worse.empty() ? "yes" : "no: " + worse));
    table_.rows.push_back(row);
    if (!paper_has || worse.empty()) return;
    std::string line;
    for (const std::string& label : labels) line += (line.empty() ? "" : ", ") + label;
    worse_.push_back(line + ": " + explanation(outcomes, above, paper, reasons));
}

std::vector<Outcome> outcomes(const CellStore& store, const std::vector<Cell>& cells) {
    std::vector<Outcome> list;
    for (const Cell& cell : cells) list.push_back(store.outcome(cell));
    return list;
}

Paths paths(const Outcome& outcome, int a, int b, const std::string& name, int colour,
            const std::vector<double>& at_s) {
    Paths result;
    result.estimate.name = name;
    result.estimate.colour = colour;
    result.truth.name = "truth";
    result.truth.colour = 5;
    result.truth.style = Series::kDashed;
    result.known.name = "known points";
    result.known.colour = 5;
    result.known.style = Series::kSquares;
    if (!outcome.ok) return result;
    ComparisonOptions how;
    how.alignment = "sim3";
    how.evaluation.at_s = at_s;
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
    const std::vector<TimedPose> aligned = apply(e.alignment.S_G_E, judged.poses);
    std::vector<TimedPose> known;
    for (const PoseError& error : e.errors) {
        known.push_back(aligned[static_cast<size_t>(error.estimate_idx)]);
        known.back().T_W_B.p -= error.position;
    }
    fill(aligned, result.estimate);
    fill(truth.poses, result.truth);
    if (!at_s.empty()) fill(known, result.known);
    result.ok = true;
    return result;
}

Plot seen_from_above(const std::string& title, const std::vector<Series>& series) {
    Plot plot;
    plot.title = title;
    plot.x_label = "x [m]", plot.y_label = "y [m]";
    plot.equal_axes = true;
    plot.height = 480;
    plot.series = series;
    return plot;
}

std::string scenario(const PaperSetup& setup, const std::string& name, int seed,
                     const std::string& arguments) {
    return "\"" + setup.datasets + "/" + name +
           ".ini\" --set images.render=false --set scenario.seed=" + std::to_string(seed) +
           (arguments.empty() ? "" : " " + arguments);
}

std::vector<Cell> seeds(const PaperSetup& setup, const std::function<Cell(int)>& cell_of) {
    std::vector<Cell> cells;
    for (int seed = 1; seed <= setup.seeds; ++seed) cells.push_back(cell_of(seed));
    return cells;
}

void append(std::vector<Cell>& all, const std::vector<Cell>& more) {
    all.insert(all.end(), more.begin(), more.end());
}

Cell started_from(Cell cell, const Cell& start) {
    cell.start = std::make_shared<Cell>(start);
    return cell;
}

std::vector<double> arm_control_times(double interval) {
    std::vector<double> at_s;
    for (int i = 0; i < 7; ++i) at_s.push_back(i * interval);
    return at_s;
}

std::string at_control_points(const std::vector<double>& at_s) {
    std::string text = "--align sim3 --at";
    for (const double t : at_s) text += " " + fixed(t, 2);
    return text;
}

std::string paper_batch(const std::string& variance, const std::string& arguments) {
    return "--estimator batch --set batch.sigma_px=2 --set batch.weighting=fixed"
           " --set batch.fixed_variance=" +
           variance +
           " --set batch.gravity=free --set batch.bias=constant --set batch.loss=none"
           " --set batch.max_iterations=500" +
           (arguments.empty() ? "" : " " + arguments);
}

namespace {

// After exactly so many images.
std::string started_from(int prefix) {
    return " --set iekf.start_wanted_tilt=1 --set iekf.prefix_images=" + std::to_string(prefix);
}

}  // namespace

std::string paper_filter(const std::string& rate_variance, const std::string& accel_variance,
                         int prefix) {
    return "--estimator iekf --set iekf.motion=smooth --set iekf.angular_rate_variance=" +
           rate_variance + " --set iekf.acceleration_variance=" + accel_variance +
           " --set iekf.sigma_px=2 --set batch.sigma_px=2" + started_from(prefix);
}

std::string own_filter(int prefix, int sigma_px) {
    const std::string sigma = std::to_string(sigma_px);
    return "--estimator iekf --set iekf.sigma_px=" + sigma + " --set batch.sigma_px=" + sigma +
           started_from(prefix) +
           " --set iekf.camera_rotation_sigma=0 --set iekf.camera_position_sigma=0"
           " --set iekf.time_offset_sigma=0";
}

const std::vector<Exhibit>& exhibits() {
    static const std::vector<Exhibit> all = [] {
        std::vector<Exhibit> list = arm_exhibits();
        for (const auto& exhibits : {omni_exhibits(), other_exhibits()})
            list.insert(list.end(), exhibits.begin(), exhibits.end());
        return list;
    }();
    return all;
}

}  // namespace vio::app
