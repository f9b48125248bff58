#include "libvio/batch/minimize.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "libvio/base/timed.h"

namespace vio::batch {
namespace {

constexpr double kSmallestDamping = 1e-12, kLargestDamping = 1e14;
constexpr double kNoCost = 1e-12;  // of exact measurements: what rounding leaves

// What steps to come will take off the cost, of which `next` the next one, after one that promised
// `promised`: where each promises a constant share of the one before (the worst case near a
// minimum).
double still_to_come(double promised, double next) {
    constexpr double kSlowest = 0.1;  // quadratic convergence may turn linear
    const double ratio = std::max(kSlowest, next / promised);
    return ratio < 1 ? next / (1 - ratio) : std::numeric_limits<double>::infinity();
}

// After Nielsen (1999).
struct Damping {
    double lambda, growth = 2;

    void adapt(double gain) {
        lambda =
            std::max(kSmallestDamping, lambda * std::max(1. / 3, 1 - std::pow(2 * gain - 1, 3)));
        growth = 2;
    }
    void raise() {
        lambda *= growth;
        growth *= 2;
    }
    // Too small to tell where a step leads: weak directions are 1e-6 of the diagonal, say.
    bool none() const { return lambda <= 1e-8; }
};

}  // namespace

MinimizeReport minimize(Objective& objective, NormalEquations& equations,
                        const MinimizeLimits& limits, State& state, RigRefinement* rig) {
    MinimizeReport report;
    const auto began = std::chrono::steady_clock::now();
    Damping damping{limits.initial_damping};
    const auto linearize = [&] {
        return timed(report.linearize_s, [&] {
            Cost cost = objective.linearize(state, equations);
            if (!rig) return cost;
            rig->linearize(objective, state, equations);
            cost.prior += rig->cost();
            return cost;
        });
    };
    Cost cost = linearize();
    report.initial = cost;
    report.reason = "iteration limit reached";
    Step step, next;
    State candidate;
    // Sets the candidate where the step leads. By how much the cost is less there.
    const auto attempt = [&] {
        return timed(report.evaluate_s, [&] {
            objective.apply(state, step, equations.layout(), candidate);
            if (rig && !rig->move(step.rig, objective))
                return -std::numeric_limits<double>::infinity();
            return cost.total() - objective.settle_points(state, candidate).total() -
                   (rig ? rig->cost() : 0);
        });
    };
    while (report.iterations < limits.max_iterations && damping.lambda <= kLargestDamping) {
        ++report.iterations;
        if (!timed(report.solve_s, [&] { return equations.solve(damping.lambda, step); })) {
            ++report.rejected;
            damping.raise();
            continue;
        }
        const double predicted = equations.predicted_decrease(step);
        const double small = limits.cost_tolerance * std::max(cost.total(), kNoCost);
        report.gradient = predicted / cost.total();
        double decrease = attempt();
        // Damping so small would lead there again: to where the cost's parabola along the step has
        // its minimum, by its slope and where it leads.
        constexpr double kShortest = 0.1;
        const double length = predicted / (2 * predicted - decrease);
        const bool shorter = decrease <= 0 && damping.none() && length >= kShortest;
        if (shorter) {
            if (rig) rig->take_back(objective);
            step *= length;
            decrease = attempt();
        }
        const bool taken = decrease > 0;
        bool converged = predicted <= small && std::abs(decrease) <= small;
        if (taken) {
            std::swap(state, candidate);
            report.progress.push_back({seconds_since(began), cost.total() - decrease});
            cost = linearize();
            const double enough = std::min(limits.negligible, 1e-5 * cost.total());
            if (enough > 0 && damping.none() && predicted < cost.total() &&
                timed(report.solve_s, [&] { return equations.resolve(next); })) {
                const double promised = equations.predicted_decrease(next);
                report.gradient = promised / cost.total();
                converged |= still_to_come(predicted, promised) <= enough;
            }
        } else {
            ++report.rejected;
            if (rig) rig->take_back(objective);
        }
        if (converged) {
            report.converged = true;
            report.reason = "cost no longer decreases";
            break;
        }
        if (taken && !shorter)
            damping.adapt(decrease / predicted);
        else
            damping.raise();
    }
    if (damping.lambda > kLargestDamping) report.reason = "no step decreases the cost";
    report.final = cost;
    return report;
}

}  // namespace vio::batch
