#include "libvio/batch/course.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "libvio/base/chi_square.h"
#include "libvio/base/median.h"
#include "libvio/batch/growth.h"
#include "libvio/batch/start.h"

namespace vio::batch {
namespace {

void minimize_stage(Course& course, const Stage& stage, MinimizeLimits limits) {
    NormalEquations equations(course.model, make_layout(course.model, course.options),
                              thread_count(course.options));
    // Without a start, ranges say nothing yet.
    if (stage.truncated) equations.point_damping = NormalEquations::PointDamping::alike;
    Objective objective(course.model, course.options, stage);
    const MinimizeReport report =
        minimize(objective, equations, limits, course.state, course.rig ? &*course.rig : nullptr);
    BatchReport& sums = course.sums;
    if (sums.iterations == 0) sums.initial_cost = report.initial.total();
    sums.iterations += report.iterations;
    sums.rejected_steps += report.rejected;
    sums.linearize_s += report.linearize_s;
    sums.solve_s += report.solve_s;
    sums.evaluate_s += report.evaluate_s;
    course.last = report;
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

// Of an estimate that starts from nothing.
const Stage kFromNothing{.gravity_free = true, .loss = "huber", .truncated = true};

// Cost that noise explains, then.
double explained_cost(const Course& course) {
    return RobustLoss(kFromNothing.loss, course.options.loss_width).noise_cost() *
           static_cast<double>(course.model.observations.size());
}

// Points that went to infinity while the poses were wrong can hold them wrong, where weak inertial
// terms let poses bend: each image contradicts a little. They are left out for a while and then
// placed anew; where that leads to no less cost, everything stays as it was.
void recall_far_points(Course& course, const Stage& stage, const MinimizeLimits& limits) {
    const std::vector<int> far = points_at_infinity(course.model, course.state);
    if (far.empty()) return;
    const State kept = course.state;
    const MinimizeReport kept_report = course.last;
    const auto set_active = [&](bool active) {
        for (int j : far) {
            const Point& point = course.model.points[j];
            for (int k = 0; k < point.observation_count; ++k)
                course.model.observations[point.first_observation + k].active = active;
        }
    };
    set_active(false);
    minimize_stage(course, stage, limits);
    set_active(true);
    bool placed = false;
    for (int j : far)
        if (const auto p_W =
                triangulate_point(course.model, course.state, course.model.points[j])) {
            course.state.points[j] = *p_W;
            placed = true;
        }
    if (placed) {
        minimize_stage(course, stage, limits);
        if (course.last.final.total() < kept_report.final.total()) return;
    }
    course.state = kept;
    course.last = kept_report;
}

// First with gravity free (it starts at zero), quadratic far from the solution. Returns the cost.
double minimize_from_nothing(Course& course, State start) {
    course.state = std::move(start);
    const MinimizeLimits limits{course.options.max_iterations,
                                std::max(1e-6, course.options.cost_tolerance), 1e-6};
    constexpr int kRounds = 3;
    for (int round = 0; round < kRounds; ++round) {
        minimize_stage(course, kFromNothing, limits);
        if (course.last.final.total() <= explained_cost(course) || !free_trapped_points(course))
            break;
    }
    if (course.model.inertial) recall_far_points(course, kFromNothing, limits);
    return course.last.final.total();
}

// A track that has left its point does not come back to it: what fits again later does so by
// chance, as the image of a point just before the lens comes by anywhere. Leaves the longest run of
// observations that fit; returns its length.
std::ptrdiff_t keep_longest_run(Observation* first, Observation* last) {
    Observation *from = first, *to = first;
    for (Observation* o = first; o != last;) {
        Observation* end = std::find_if(o, last, [](const Observation& x) { return !x.active; });
        if (end - o > to - from) from = o, to = end;
        o = end == last ? last : end + 1;
    }
    for (Observation* o = first; o != last; ++o) o->active = o >= from && o < to;
    return to - from;
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
        Observation* last = first + point.observation_count;
        auto active = std::count_if(first, last, [](const Observation& o) { return o.active; });
        if (2 * active <= point.observation_count) active = keep_longest_run(first, last);
        if (active < 2 && !point.fiducial)
            for (int k = 0; k < point.observation_count; ++k) first[k].active = false;
    }
    return any;
}

// A track that has jumped from one place to another shows no point. What lies between both may come
// within reach of most of its observations, which then pull all one way, by more than noise does. A
// track's squared residuals are judged by those that noise makes, or, where sigma_px is too small,
// by those of most. True if any were dropped.
bool drop_tracks_of_no_point(Course& course) {
    constexpr double kNormalQuantile = 3.09;  // of 99.9 %
    if (course.options.outlier_sigmas == 0) return false;
    const Objective objective(course.model, course.options, {});
    struct Fit {
        Observation *first, *last;
        double ratio, limit;  // of the squared residuals to their degrees of freedom
    };
    std::vector<Fit> fits;
    std::vector<double> ratios;
    for (const Point& point : course.model.points) {
        Observation* first = &course.model.observations[point.first_observation];
        Observation* last = first + point.observation_count;
        double squared = 0;
        int dof = -3;
        for (const Observation* o = first; o != last; ++o) {
            if (!o->active) continue;
            squared += objective.observation_distance2(course.state, *o);
            dof += 2;
        }
        if (point.fiducial || dof <= 0) continue;
        fits.push_back({first, last, squared / dof, chi_square_value(dof, kNormalQuantile) / dof});
        ratios.push_back(squared / dof);
    }
    if (fits.empty()) return false;
    const double usual = std::max(1.0, median(std::move(ratios)));
    bool any = false;
    for (const Fit& fit : fits) {
        if (fit.ratio <= usual * fit.limit) continue;
        for (Observation* o = fit.first; o != fit.last; ++o) o->active = false;
        any = true;
    }
    return any;
}

// Few observations with next to no parallax leave their point's distance to noise. What they seem
// to tell of the poses grows as the square of its nearness: of a point that came out near by noise
// alone, far beyond what they can tell; of one at a camera's centre, where any direction explains
// its observation, beyond what the equations can hold. True if there were any of these points.
bool drop_points(Course& course, const std::vector<int>& points) {
    for (const int j : points) {
        const Point& point = course.model.points[j];
        for (int k = 0; k < point.observation_count; ++k)
            course.model.observations[point.first_observation + k].active = false;
    }
    return !points.empty();
}

// The paper's start, and where that ends with more cost than noise explains, a second one.
void start_with_readings(Course& course) {
    const double cost = minimize_from_nothing(course, blind_start(course.model, course.options));
    if (cost <= explained_cost(course)) return;
    State first = std::move(course.state);
    if (!(minimize_from_nothing(course, turning_start(course.model, course.options)) < cost))
        course.state = std::move(first);
}

// Images alone have many minima: only where no two of them tell a motion is there nothing better
// than the paper's start.
void start_with_images(Course& course) {
    auto grown = grow_from_two_views(course.model, course.options);
    if (!grown) {
        minimize_from_nothing(course, blind_start(course.model, course.options));
        return;
    }
    course.state = std::move(grown->state);
    // Of a part, the images that a staged start goes on with may tell.
    const bool whole = course.model.frames() == static_cast<int>(course.problem.frames.size());
    course.start_confirmed = grown->confirmed || !whole;
}

}  // namespace

bool gravity_known(const Course& course) {
    return course.state.gravity.norm() > 0.5 * course.options.gravity_norm;
}

void fix_gravity_norm(Course& course) {
    if (course.model.inertial && course.options.gravity == "magnitude" &&
        course.state.gravity.norm() > 0)
        course.state.gravity *= course.options.gravity_norm / course.state.gravity.norm();
}

void start_blind(Course& course, int images) {
    course.model = make_model(course.problem, course.options, images, 2);
    if (course.model.inertial)
        start_with_readings(course);
    else
        start_with_images(course);
    fix_gravity_norm(course);
    free_trapped_points(course);
}

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

void minimize_all(Course& course) {
    const Stage stage{course.options.gravity == "free", course.options.loss};
    const MinimizeLimits limits{course.options.max_iterations, course.options.cost_tolerance};
    if (const RigUnknowns unknowns = rig_unknowns(course.problem.rig, course.options);
        unknowns.count() > 0) {
        // Far from the solution a wrong rig would explain what wrong poses do.
        constexpr double kNearly = 1e-4;
        minimize_stage(course, stage, {limits.max_iterations, kNearly});
        free_trapped_points(course);
        course.rig.emplace(course.problem, course.model, unknowns,
                           rig_sigmas(course.problem.rig, course.options));
    }
    minimize_stage(course, stage, limits);
    if (free_trapped_points(course)) minimize_stage(course, stage, limits);
    bool dropped = drop_outliers(course);
    constexpr int kRounds = 3;
    for (int round = 0; round < kRounds; ++round) {
        dropped |= drop_points(course, points_at_cameras(course.model, course.state));
        if (!dropped) {  // of the minimum without those
            dropped = drop_tracks_of_no_point(course);
            dropped |= drop_points(course, points_near_by_noise(course.model, course.state));
        }
        if (!std::exchange(dropped, false)) break;
        minimize_stage(course, stage, limits);
    }
}

}  // namespace vio::batch
