#include "libvio/batch/minimize.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

namespace vio::batch {
namespace {

constexpr double kSmallestDamping = 1e-12, kLargestDamping = 1e14;
constexpr double kNoCost = 1e-12;  // of exact measurements: what rounding leaves

// Calls work() and adds the time that it took.
template <typename Work>
auto timed(double& seconds, Work work) {
    struct Watch {
        double& total;
        std::chrono::steady_clock::time_point began = std::chrono::steady_clock::now();
        ~Watch() {
            total +=
                std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
        }
    } watch{seconds};
    return work();
}

}  // namespace

MinimizeReport minimize(Objective& objective, NormalEquations& equations,
                        const MinimizeLimits& limits, State& state) {
    MinimizeReport report;
    double lambda = limits.initial_damping, growth = 2;
    const auto linearize = [&] {
        return timed(report.linearize_s, [&] { return objective.linearize(state, equations); });
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
                return objective.evaluate(candidate).total();
            });
            const double decrease = cost.total() - now;
            const double predicted = equations.predicted_decrease(step);
            const double small = limits.cost_tolerance * std::max(cost.total(), kNoCost);
            report.gradient = predicted / cost.total();
            accepted = std::isfinite(now) && decrease > 0;
            if (accepted) std::swap(state, candidate);
            if (std::isfinite(now) && predicted <= small && std::abs(decrease) <= small) {
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
