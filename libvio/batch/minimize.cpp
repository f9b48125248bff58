#include "libvio/batch/minimize.h"

#include <algorithm>
#include <cmath>

namespace vio::batch {
namespace {

constexpr double kInitialDamping = 1e-4, kSmallestDamping = 1e-12, kLargestDamping = 1e14;

}  // namespace

MinimizeReport minimize(Objective& objective, NormalEquations& equations,
                        const MinimizeLimits& limits, State& state) {
    MinimizeReport report;
    double lambda = kInitialDamping, growth = 2;
    Cost cost = objective.linearize(state, equations);
    report.initial = report.final = cost;
    report.reason = "iteration limit reached";
    Step step;
    while (report.iterations < limits.max_iterations) {
        ++report.iterations;
        bool accepted = false;
        if (equations.solve(lambda, step)) {
            State candidate = objective.apply(state, step, equations.layout());
            const double now = objective.evaluate(candidate).total();
            const double decrease = cost.total() - now;
            const double predicted = equations.predicted_decrease(step);
            if (std::isfinite(now) && predicted <= limits.cost_tolerance * cost.total() &&
                std::abs(decrease) <= limits.cost_tolerance * cost.total()) {
                if (decrease > 0) state = std::move(candidate);
                report.converged = true;
                report.reason = "cost no longer decreases";
                break;
            }
            if (std::isfinite(now) && decrease > 0) {
                accepted = true;
                const double gain = decrease / predicted;
                lambda = std::max(kSmallestDamping,
                                  lambda * std::max(1.0 / 3, 1 - std::pow(2 * gain - 1, 3)));
                growth = 2;
                state = std::move(candidate);
                cost = objective.linearize(state, equations);
            }
        }
        if (!accepted) {
            lambda *= growth;
            growth *= 2;
            if (lambda > kLargestDamping) {
                report.reason = "no step decreases the cost";
                break;
            }
        }
    }
    report.final = objective.linearize(state, equations);
    return report;
}

}  // namespace vio::batch
