#include "libvio/batch/batch.h"

#include <algorithm>
#include <cmath>

#include "libvio/base/timed.h"
#include "libvio/batch/course.h"
#include "libvio/batch/marginals.h"
#include "libvio/batch/observability.h"
#include "libvio/batch/scale_noise.h"
#include "libvio/batch/start.h"
#include "libvio/tracking/keyframes.h"

namespace vio {

using namespace batch;

namespace {

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

BatchReport make_report(const Course& course, SteadyTime began) {
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

RefinedRig refined_rig(const RigRefinement& found, const NormalEquations& equations) {
    RefinedRig refined{found.rig(), {}, {}};
    if (const auto& rig = equations.rig_solution()) {
        const Eigen::Index size = rig->covariance.rows();
        refined.covariance = equations.shared_errors()->covariance.topLeftCorner(size, size);
    }
    const auto names = found.names(), units = found.units();
    const Eigen::VectorXd change = found.change();
    for (Eigen::Index k = 0; k < change.size(); ++k)
        refined.unknowns.push_back(
            {names[k], units[k], change(k),
             refined.covariance.size() > 0 ? std::sqrt(refined.covariance(k, k)) : 0,
             found.held(k) ? 0 : found.sigmas()(k)});
    return refined;
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
        if (course.rig && !equations.rig_solution())
            report.undetermined.push_back("the rig's " +
                                          course.rig->names()[equations.weakest_rig_unknown()]);
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
    const auto began = std::chrono::steady_clock::now();
    const RigUnknowns open = rig_unknowns(given.rig, options);
    if (given.imu.empty() && (open.extrinsics || open.time_offset))
        throw InputError(
            "batch estimator: images alone tell neither the camera's place on the IMU nor their "
            "time offset; leave batch.extrinsics_rotation_sigma, extrinsics_position_sigma and "
            "time_offset_sigma out");
    std::optional<BatchProblem> rest;
    if (given.imu.empty())
        rest = without_unseeing_images(given);
    else if (open.time_offset)
        rest = without_images_at_ends(given, options.time_offset_sigma);
    const BatchProblem& problem = rest ? *rest : given;

    Course course{problem, options};

    // 1. A first estimate of everything.
    const int images = static_cast<int>(problem.frames.size());
    if (start) {
        course.model = make_model(problem, options, images);
        course.state = given_start(course.model, *start);
        fix_gravity_norm(course);
    } else if (options.start == "blind") {
        start_blind(course, images);
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
    const Stage stage{
        .gravity_free = options.gravity == "free", .loss = options.loss, .information = true};
    Objective objective(course.model, options, stage);
    NormalEquations equations(course.model, make_layout(course.model, options),
                              objective.threads());
    objective.linearize(course.state, equations);
    if (course.rig) course.rig->linearize(objective, course.state, equations);
    const bool singular = !equations.factorize();
    if (!singular && course.model.inertial && !course.model.surveyed() &&
        options.weighting != "fixed")
        widen_scale(course.model, objective, course.state, equations);
    result.estimate =
        publish(course.model, objective, course.state, select_keyframes(problem.frames),
                options.covariances && !singular ? &equations : nullptr);
    if (want_tail && !singular)
        result.tail = publish_tail(course.model, objective, course.state, equations);
    course.sums.covariance_s = seconds_since(began) - course.sums.start_s - course.sums.minimize_s;
    result.report = make_report(course, began);
    if (course.rig) result.rig = refined_rig(*course.rig, equations);
    judge_solution(course, objective, equations, singular, result.report);
    if (result.report.converged && !course.start_confirmed) {
        result = {{}, result.report, {}, {}};
        result.report.converged = false;
        result.report.reason =
            "no two of the starts that were tried, each grown from another pair of images, led to "
            "the same estimate: give a start, or tracks with fewer mistakes";
    }
    return result;
}

}  // namespace vio
