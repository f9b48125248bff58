#include "app/paper_arm.h"

namespace vio::app {
namespace {

constexpr const char* kOwnWeights = "the batch estimate weighted by the readings' noise";

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
    return seeds(setup, [&](int seed) {
        return slowed(arm(setup, seed, "--estimator batch --set batch.sigma_px=2"), factor, seed);
    });
}

Yardstick own_weights(const PaperSetup& setup, const CellStore& store, int factor) {
    return {kOwnWeights, outcomes(store, default_batch(setup, factor))};
}

std::vector<Exhibit> arm_exhibits() {
    std::vector<Exhibit> all = arm_batch_exhibits();
    for (const Exhibit& exhibit : arm_filter_exhibits()) all.push_back(exhibit);
    return all;
}

}  // namespace vio::app
