#include "app/paper_arm.h"

#include "app/comparison.h"

namespace vio::app {
namespace {

constexpr const char* kOwnWeights = "the batch estimate weighted by the readings' noise";
constexpr const char* kOwnBatch = "--estimator batch --set batch.sigma_px=2";

// When the batch estimates of growing_batches() end [s after the first image].
std::vector<double> ends(int prefix) {
    constexpr double kImageInterval = 1.0 / 30;
    std::vector<double> ends = {(prefix - 1) * kImageInterval};
    for (const double t : arm_control_times(kArmInterval))
        if (t > ends.front()) ends.push_back(t);
    return ends;
}

// Of each outcome the poses after those of the one before, judged as one.
Outcome joined(const std::vector<Outcome>& outcomes, const std::vector<double>& at_s) {
    Outcome all = outcomes.front();
    all.evaluations.clear();
    JudgedResult judged;
    for (const Outcome& outcome : outcomes) {
        all.ok = all.ok && outcome.ok;
        if (!outcome.ok) continue;
        for (const TimedPose& row : read_judged(outcome.result).poses)
            if (judged.poses.empty() || row.t > judged.poses.back().t) judged.poses.push_back(row);
    }
    if (!all.ok) return all;
    ComparisonOptions how;
    how.alignment = "sim3";
    how.evaluation.at_s = at_s;
    all.evaluations = {to_json(compare(judged, read_reference(all.truth), how))};
    return all;
}

}  // namespace

Cell arm(const PaperSetup& setup, int seed, const std::string& run) {
    Cell cell;
    cell.simulate = scenario(setup, "perspective_arm", seed);
    cell.run = run;
    cell.evaluate = at_control_points(arm_control_times(kArmInterval));
    return cell;
}

Cell slowed(Cell cell, int factor, int seed) {
    if (factor == 1) return cell;
    cell.evaluate = at_control_points(arm_control_times(factor * kArmInterval));
    cell.slow = "--factor " + std::to_string(factor) + " --seed " + std::to_string(seed);
    cell.run += " --set batch.gravity_norm=" + fixed(9.81 / (factor * factor), 6);
    return cell;
}

Measures measured(const CellStore& store, const std::vector<Cell>& cells) {
    return measure(outcomes(store, cells));
}

std::vector<Cell> default_batch(const PaperSetup& setup, int factor) {
    return seeds(setup,
                 [&](int seed) { return slowed(arm(setup, seed, kOwnBatch), factor, seed); });
}

Yardstick own_weights(const PaperSetup& setup, const CellStore& store, int factor) {
    return {kOwnWeights, outcomes(store, default_batch(setup, factor))};
}

std::vector<Cell> growing_batches(const PaperSetup& setup, int prefix, int factor) {
    // Readings begin before the first image, and the last image needs one after it [s].
    constexpr double kMargin = 0.05, kReadings = 0.03;
    std::vector<Cell> all;
    for (const double end : ends(prefix)) {
        const std::string run =
            std::string(kOwnBatch) + " --to " + fixed(factor * (end + kMargin + kReadings), 3);
        append(all, seeds(setup, [&](int seed) {
                   Cell cell = slowed(arm(setup, seed, run), factor, seed);
                   cell.evaluate.clear();
                   return cell;
               }));
    }
    return all;
}

Yardstick causal_batches(const PaperSetup& setup, const CellStore& store, int prefix, int factor) {
    const std::vector<Outcome> all = outcomes(store, growing_batches(setup, prefix, factor));
    const auto recordings = static_cast<size_t>(setup.seeds);
    Yardstick yardstick{"batch estimates of no later images than the filter's", {}};
    for (size_t i = 0; i < recordings; ++i) {
        std::vector<Outcome> growing;
        for (size_t k = i; k < all.size(); k += recordings) growing.push_back(all[k]);
        yardstick.outcomes.push_back(joined(growing, arm_control_times(factor * kArmInterval)));
    }
    return yardstick;
}

std::vector<Exhibit> arm_exhibits() {
    std::vector<Exhibit> all = arm_batch_exhibits();
    for (const Exhibit& exhibit : arm_filter_exhibits()) all.push_back(exhibit);
    return all;
}

}  // namespace vio::app
