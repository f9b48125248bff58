#include "libvio/batch/minimize.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

namespace vio::batch {
namespace {

constexpr double kSmallestDamping = 1e-12, kLargestDamping = 1e14;
constexpr double kNoCost = 1e-12;  // of exact measurements: what rounding leaves

double seconds_since(std::chrono::steady_clock::time_point began) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
}

// Calls work() and adds the time that it took.
template <typename Work>
auto timed(double& seconds, Work work) {
    struct Watch {
        double& total;
        std::chrono::steady_clock::time_point began = std::chrono::steady_clock::now();
        ~Watch() { total += seconds_since(began); }
    } watch{seconds};
    return work();
}

// What steps to come will take off the cost where each promises a constant share of the one before
// (the worst case near a minimum). Damping hides what is to come.
double still_to_come(double lambda, double promised_before, double promised) {
    constexpr double kUndamped = 1e-8;  // weak directions are 1e-6 of the diagonal, say
    constexpr double kSlowest = 0.1;    // quadratic convergence may turn linear
    const double ratio = std::max(kSlowest, promised / promised_before);
    if (lambda > kUndamped || !(ratio < 1)) return std::numeric_limits<double>::infinity();
    return promised * ratio / (1 - ratio);
}

}  // namespace

MinimizeReport minimize(Objective& objective, NormalEquations& equations,
                        const MinimizeLimits& limits, State& state, RigRefinement* rig) {
    MinimizeReport report;
    const auto began = std::chrono::steady_clock::now();
    double lambda = limits.initial_damping, growth = 2;
    double promised_before = 0;  // by the last step, if it was taken
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
    Step step;
    State candidate;
    while (report.iterations < limits.max_iterations) {
        ++report.iterations;
        bool accepted = false;
        if (timed(report.solve_s, [&] { return equations.solve(lambda, step); })) {
            const double now = timed(report.evaluate_s, [&] {
                objective.apply(state, step, equations.layout(), candidate);
                if (rig && !rig->move(step.rig, objective))
                    return std::numeric_limits<double>::infinity();
                return objective.settle_points(state, candidate).total() + (rig ? rig->cost() : 0);
            });
            const double decrease = cost.total() - now;
            const double predicted = equations.predicted_decrease(step);
            const double small = limits.cost_tolerance * std::max(cost.total(), kNoCost);
            report.gradient = predicted / cost.total();
            accepted = std::isfinite(now) && decrease > 0;
            if (accepted) {
                std::swap(state, candidate);
                report.progress.push_back({seconds_since(began), now});
            } else if (rig)
                rig->take_back(objective);
            const double left = still_to_come(lambda, promised_before, predicted);
            promised_before = accepted ? predicted : 0;
            if ((std::isfinite(now) && predicted <= small && std::abs(decrease) <= small) ||
                (accepted && left <= std::min(limits.negligible, 1e-5 * cost.total()))) {
                if (accepted) cost = linearize();
                report.converged = true;
                report.reason = "cost no longer decreases";
                break;
            }
            if (accepted) {
                const double gain = decrease / predicted;
                lambda = std::max(kSmallestDamping,
                                  lambda * std::max(1. / 3, 1 - std::pow(2 * gain - 1, 3)));
                growth = 2;
                cost = linearize();
            }
        }
        if (!accepted) {
            ++report.rejected;
            lambda *= growth;
            growth *= 2;
            if (lambda > kLargestDamping) {
                report.reason = "no step decreases the cost";
                break;
            }
        }
    }
    report.final = cost;
    return report;
}

}  // namespace vio::batch
