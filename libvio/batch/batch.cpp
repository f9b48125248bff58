#include "libvio/batch/batch.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "libvio/batch/marginals.h"
#include "libvio/batch/minimize.h"
#include "libvio/batch/observability.h"
#include "libvio/batch/start.h"
#include "libvio/tracking/keyframes.h"

namespace vio {

using namespace batch;

namespace {

using Clock = std::chrono::steady_clock;

// A model of the first images, its state, and what happened to it.
struct Course {
    const BatchProblem& problem;
    const BatchOptions& options;
    Model model;
    State state;
    MinimizeReport last;
    BatchReport sums;  // iterations and times so far
};

void minimize_stage(Course& course, const Stage& stage, MinimizeLimits limits) {
    NormalEquations equations(course.model, make_layout(course.model, course.options),
                              thread_count(course.options));
    // Without a start, ranges say nothing yet.
    if (stage.truncated) equations.point_damping = NormalEquations::PointDamping::alike;
    Objective objective(course.model, course.options, stage);
    const MinimizeReport report = minimize(objective, equations, limits, course.state);
    BatchReport& sums = course.sums;
    if (sums.iterations == 0) sums.initial_cost = report.initial.total();
    sums.iterations += report.iterations;
    sums.rejected_steps += report.rejected;
    sums.linearize_s += report.linearize_s;
    sums.solve_s += report.solve_s;
    sums.evaluate_s += report.evaluate_s;
    course.last = report;
}

bool gravity_known(const Course& course) {
    return course.state.gravity.norm() > 0.5 * course.options.gravity_norm;
}

// Puts gravity's norm where it belongs; the minimisation that follows settles the rest.
void fix_gravity_norm(Course& course) {
    if (course.model.inertial && course.options.gravity == "magnitude" &&
        course.state.gravity.norm() > 0)
        course.state.gravity *= course.options.gravity_norm / course.state.gravity.norm();
}

// Points that most of their images disagree with have been trapped (on the wrong side of a camera,
// or placed from poses that were wrong then): the robust loss would never let them go. True if any
// was moved.
bool free_trapped_points(Course& course) {
    const double limit2 = std::pow(course.options.loss_width * 2, 2);
    const Objective objective(course.model, course.options, {});
    bool moved_any = false;
    for (size_t j = 0; j < course.model.points.size(); ++j) {
        const Point& point = course.model.points[j];
        const auto misfits = [&](const State& state) {
            int count = 0;
            for (int k = 0; k < point.observation_count; ++k)
                count +=
                    objective.observation_distance2(
                        state, course.model.observations[point.first_observation + k]) > limit2;
            return count;
        };
        const int before = misfits(course.state);
        if (point.fiducial || 2 * before <= point.observation_count) continue;
        const auto moved = triangulate_point(course.model, course.state, point);
        if (!moved) continue;
        const Eigen::Vector3d kept = std::exchange(course.state.points[j], *moved);
        if (misfits(course.state) >= before)
            course.state.points[j] = kept;
        else
            moved_any = true;
    }
    return moved_any;
}

// Cost that noise explains: two for each observation.
double explained_cost(const Model& model) {
    return 2 * static_cast<double>(model.observations.size());
}

// First with gravity free (it starts at zero), quadratic far from the solution. Returns the cost.
double minimize_from_nothing(Course& course, State start) {
    course.state = std::move(start);
    constexpr int kRounds = 3;
    for (int round = 0; round < kRounds; ++round) {
        minimize_stage(
            course, {true, "huber", true},
            {course.options.max_iterations, std::max(1e-6, course.options.cost_tolerance), 1e-6});
        if (course.last.final.total() <= explained_cost(course.model) ||
            !free_trapped_points(course))
            break;
    }
    return course.last.final.total();
}

// From nothing: the paper's start, and where that ends with more cost than noise explains, a second
// one that lets the cameras turn as the gyro says; the better of the two.
void start_blind(Course& course, int images) {
    course.model = make_model(course.problem, course.options, images, 2);
    const double cost = minimize_from_nothing(course, blind_start(course.model, course.options));
    if (course.model.inertial && !(cost <= explained_cost(course.model))) {
        State first = std::move(course.state);
        if (!(minimize_from_nothing(course, turning_start(course.model, course.options)) < cost))
            course.state = std::move(first);
    }
    fix_gravity_norm(course);
}

// Grows the estimate from a prefix to all images, by a quarter at a time.
void start_staged(Course& course) {
    const int all = static_cast<int>(course.problem.frames.size());
    int images = std::min(all, course.options.prefix_images);
    start_blind(course, images);
    constexpr int kIterationsPerStage = 8;
    const bool free = course.options.gravity == "free";
    while (images < all) {
        minimize_stage(course, {free, course.options.loss}, {kIterationsPerStage, 1e-4});
        free_trapped_points(course);
        images = std::min(all, std::max(images + 10, images * 5 / 4));
        Model longer = make_model(course.problem, course.options, images);
        course.state = continued_start(longer, course.model, course.state);
        course.model = std::move(longer);
    }
}

// Marks observations that do not fit; true if there are any new ones.
bool drop_outliers(Course& course) {
    const double limit2 = course.options.outlier_sigmas * course.options.outlier_sigmas;
    if (limit2 == 0) return false;
    const Objective objective(course.model, course.options, {});
    bool any = false;
    for (Observation& observation : course.model.observations)
        if (observation.active &&
            objective.observation_distance2(course.state, observation) > limit2) {
            observation.active = false;
            any = true;
        }
    // What is left of a point must still fix it.
    for (const Point& point : course.model.points) {
        Observation* first = &course.model.observations[point.first_observation];
        const auto active = std::count_if(first, first + point.observation_count,
                                          [](const Observation& o) { return o.active; });
        if (active < 2 && !point.fiducial)
            for (int k = 0; k < point.observation_count; ++k) first[k].active = false;
    }
    return any;
}

void minimize_all(Course& course) {
    const Stage stage{course.options.gravity == "free", course.options.loss};
    const MinimizeLimits limits{course.options.max_iterations, course.options.cost_tolerance};
    minimize_stage(course, stage, limits);
    if (free_trapped_points(course)) minimize_stage(course, stage, limits);
    if (drop_outliers(course)) minimize_stage(course, stage, limits);
}

// Why the start that was tried led nowhere; empty: it did not.
std::string failure_of_start(const Course& course) {
    if (course.model.inertial && !gravity_known(course))
        return "gravity was not found from the start that was tried";
    constexpr double kUsualLimit = 5;
    const double sigmas = course.options.outlier_sigmas;
    const double limit2 = std::pow(sigmas > 0 ? sigmas : kUsualLimit, 2);
    const Objective objective(course.model, course.options, {});
    const auto& observations = course.model.observations;
    const auto contradicting =
        std::count_if(observations.begin(), observations.end(), [&](const Observation& o) {
            return !(objective.observation_distance2(course.state, o) <= limit2);
        });
    if (2 * contradicting <= static_cast<std::ptrdiff_t>(observations.size())) return {};
    return "the start that was tried led to an estimate that most observations contradict (" +
           std::to_string(contradicting) + " of " + std::to_string(observations.size()) +
           " by more than " + std::to_string(static_cast<int>(std::sqrt(limit2))) +
           " sigma_px): try another start, or compare sigma_px with the tracks";
}

double seconds_since(Clock::time_point began) {
    return std::chrono::duration<double>(Clock::now() - began).count();
}

BatchReport make_report(const Course& course, Clock::time_point began) {
    BatchReport report = course.sums;
    report.converged = course.last.converged;
    report.reason = course.last.reason;
    report.final_cost = course.last.final.total();
    report.image_cost = course.last.final.image;
    report.inertial_cost = course.last.final.inertial;
    report.prior_cost = course.last.final.prior;
    report.gradient = course.last.gradient;
    for (const Observation& observation : course.model.observations)
        ++(observation.active ? report.observations : report.outliers);
    report.seconds = seconds_since(began);
    return report;
}

// Says in the report what the measurements leave open.
void judge_solution(const Course& course, const Objective& objective, NormalEquations& equations,
                    bool singular, BatchReport& report) {
    if (singular) {
        report.undetermined = {name_null_space(course.model, equations)};
    } else {
        report.reciprocal_condition = equations.factor().reciprocal_condition();
        const Observability found = judge(course.model, objective, course.state, equations);
        report.scale_sigma = found.scale_sigma;
        report.undetermined = found.undetermined;
    }
    if (report.undetermined.empty()) return;
    report.converged = false;
    report.reason = "not determined by the measurements: ";
    for (const std::string& what : report.undetermined)
        report.reason += (&what == &report.undetermined.front() ? "" : "; ") + what;
}

}  // namespace

BatchResult estimate_batch(const BatchProblem& given, const BatchOptions& options,
                           const std::optional<Estimate>& start, bool want_tail) {
    const auto began = Clock::now();
    std::optional<BatchProblem> rest;
    if (given.imu.empty()) rest = without_unseeing_images(given);
    const BatchProblem& problem = rest ? *rest : given;
    const int images = static_cast<int>(problem.frames.size());
    Course course{problem, options, {}, {}, {}, {}};

    // 1. A first estimate of everything.
    if (start) {
        course.model = make_model(problem, options, images);
        course.state = given_start(course.model, *start);
        fix_gravity_norm(course);
    } else if (options.start == "blind") {
        start_blind(course, images);
        free_trapped_points(course);
    } else {
        start_staged(course);
    }
    course.sums.start_s = seconds_since(began);

    // 2. The minimum over everything, without outliers.
    if (!course.model.inertial || gravity_known(course)) minimize_all(course);
    course.sums.minimize_s = seconds_since(began) - course.sums.start_s;
    BatchResult result;
    if (const std::string failure = failure_of_start(course); !failure.empty()) {
        result.report = make_report(course, began);
        result.report.converged = false;
        result.report.reason = failure;
        return result;
    }

    // 3. What is published: frames, covariances, and what they leave open.
    const Stage stage{options.gravity == "free", options.loss};
    Objective objective(course.model, options, stage);
    NormalEquations equations(course.model, make_layout(course.model, options),
                              objective.threads());
    objective.linearize(course.state, equations);
    bool singular = false;
    result.estimate =
        publish(course.model, objective, course.state, select_keyframes(problem.frames),
                options.covariances ? &equations : nullptr, singular);
    if (want_tail) result.tail = publish_tail(course.model, objective, course.state, equations);
    course.sums.covariance_s = seconds_since(began) - course.sums.start_s - course.sums.minimize_s;
    result.report = make_report(course, began);
    if (options.covariances) judge_solution(course, objective, equations, singular, result.report);
    return result;
}

}  // namespace vio
