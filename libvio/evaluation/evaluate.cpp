#include "libvio/evaluation/evaluate.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "libvio/base/angles.h"
#include "libvio/base/errors.h"
#include "libvio/base/median.h"
#include "libvio/evaluation/plausibility.h"
#include "libvio/evaluation/time_offset.h"

namespace vio {
namespace {

std::string seconds_text(TimeNs t) {
    char text[32];
    std::snprintf(text, sizeof(text), "%.3f s", to_seconds(t));
    return text;
}

// Time is allowed to jitter; one missing row makes an interval of twice the median.
constexpr double kGapIntervals = 2.5;

// Of rows in the order of time; 0 for fewer than two.
template <typename Row>
TimeNs median_interval(const std::vector<Row>& rows) {
    std::vector<TimeNs> intervals;
    for (size_t i = 1; i < rows.size(); ++i) intervals.push_back(rows[i].t - rows[i - 1].t);
    return intervals.empty() ? 0 : median(std::move(intervals));
}

std::vector<TruthGap> gaps(const std::vector<TimedPose>& truth,
                           const std::vector<TimedPose>& estimate, const Evaluation& e) {
    const TimeNs offset = from_seconds(e.time_offset_s), limit = from_seconds(e.max_gap_s);
    std::vector<TruthGap> list;
    for (size_t i = 1; i < truth.size(); ++i) {
        const TruthGap gap{truth[i - 1].t - offset, truth[i].t - offset};
        if (gap.to - gap.from <= limit) continue;
        if (gap.to > estimate.front().t && gap.from < estimate.back().t) list.push_back(gap);
    }
    return list;
}

void settle_time(const std::vector<TimedPose>& estimate, const std::vector<TimedPose>& truth,
                 const EvaluationOptions& options, Evaluation& e) {
    e.max_gap_s =
        options.max_gap_s ? *options.max_gap_s : kGapIntervals * to_seconds(median_interval(truth));
    e.time_offset_s = options.time_offset_s;
    if (options.time_offset_search_s <= 0) return;
    const auto offset =
        estimate_time_offset(estimate, truth, options.T_B_T, options.alignment,
                             from_seconds(e.max_gap_s), options.time_offset_search_s);
    if (!offset)
        throw InputError(options.estimate_name + " against " + options.truth_name +
                         ": no time offset within " +
                         seconds_text(from_seconds(options.time_offset_search_s)) +
                         " fits better than its neighbours; search farther, or give it");
    e.time_offset_s = *offset;
    e.time_offset_estimated = true;
}

// Of poses in the order of time, the one nearest to each of the times, unless it is farther away
// than the next would be.
std::vector<PosePair> nearest_pairs(const std::vector<PosePair>& pairs, std::vector<double> at_s,
                                    TimeNs origin) {
    const TimeNs reach = median_interval(pairs);
    std::sort(at_s.begin(), at_s.end());
    std::vector<PosePair> chosen;
    for (const double at : at_s) {
        const TimeNs t = origin + from_seconds(at);
        const auto distance = [t](const PosePair& pair) { return std::abs(pair.t - t); };
        const auto nearest = std::min_element(
            pairs.begin(), pairs.end(),
            [&](const PosePair& a, const PosePair& b) { return distance(a) < distance(b); });
        if (nearest == pairs.end() || distance(*nearest) > reach) continue;
        if (chosen.empty() || chosen.back().t != nearest->t) chosen.push_back(*nearest);
    }
    return chosen;
}

std::vector<PosePair> associated_pairs(const std::vector<TimedPose>& estimate,
                                       const std::vector<TimedPose>& truth,
                                       const EvaluationOptions& options, const Evaluation& e) {
    const TimeNs offset = from_seconds(e.time_offset_s);
    auto pairs = associate(estimate, truth, from_seconds(e.max_gap_s), offset);
    const std::string both = options.estimate_name + " against " + options.truth_name + ": ";
    if (pairs.empty()) {
        if (estimate.back().t + offset < truth.front().t ||
            estimate.front().t + offset > truth.back().t)
            throw InputError(both + "no overlap in time (" + seconds_text(estimate.front().t) +
                             " to " + seconds_text(estimate.back().t) + ", truth " +
                             seconds_text(truth.front().t) + " to " + seconds_text(truth.back().t) +
                             "); check the clocks and the unit of the stamps");
        throw InputError(both + "no pose lies between rows of truth at most " +
                         seconds_text(from_seconds(e.max_gap_s)) + " apart; allow a wider gap");
    }
    if (!options.at_s.empty()) pairs = nearest_pairs(pairs, options.at_s, truth.front().t);
    if (pairs.size() < 2)
        throw InputError(
            both + (pairs.empty() ? "no" : "only one") +
            (options.at_s.empty()
                 ? " pose has truth at its time"
                 : " pose with truth is near the given times (seconds after the truth's first)") +
            "; at least two are needed");
    for (PosePair& pair : pairs) pair.estimate = pair.estimate * options.T_B_T;
    return pairs;
}

std::pair<Eigen::Matrix3Xd, Eigen::Matrix3Xd> positions(const std::vector<PosePair>& pairs) {
    Eigen::Matrix3Xd p_E(3, static_cast<Eigen::Index>(pairs.size())), p_G = p_E;
    for (Eigen::Index i = 0; i < p_E.cols(); ++i) {
        p_E.col(i) = pairs[static_cast<size_t>(i)].estimate.p;
        p_G.col(i) = pairs[static_cast<size_t>(i)].truth.p;
    }
    return {p_E, p_G};
}

/// Throws InputError if the path does not determine the alignment.
void require_determined(const Alignment& alignment, const EvaluationOptions& options) {
    const std::string where = options.estimate_name + " against " + options.truth_name + ": ";
    const std::string kind = to_string(alignment.kind);
    switch (alignment.status) {
        case AlignmentStatus::kDetermined:
            return;
        case AlignmentStatus::kTooFewPoints:
            throw InputError(where + kind + " alignment needs at least two poses");
        case AlignmentStatus::kStationary:
            throw InputError(
                where + "the path stays in one place" +
                (alignment.kind == AlignmentKind::kYawPosition ? " seen from above" : "") +
                ", which leaves the " + kind + " alignment undetermined; ask for alignment none");
        case AlignmentStatus::kCollinear:
            throw InputError(
                where + "the path is a straight line, which leaves the rotation of the " + kind +
                " alignment undetermined; align position and yaw alone (--align yaw)");
    }
}

/// Scale by Sim(3), Eq. (27). A line still tells it; two points would fit any truth.
std::optional<double> scale_error(const Eigen::Matrix3Xd& p_E, const Eigen::Matrix3Xd& p_G) {
    const Alignment sim3 = align(p_E, p_G, AlignmentKind::kSim3);
    const bool told =
        sim3.status == AlignmentStatus::kDetermined || sim3.status == AlignmentStatus::kCollinear;
    if (!told || p_E.cols() < 3 || !(sim3.S_G_E.s > 0)) return std::nullopt;
    return 1 / sim3.S_G_E.s - 1;
}

Completion completion(const std::vector<TimedPose>& estimate, const ExpectedImages& images) {
    Completion result;
    const auto known = [&](TimeNs t) {
        return !std::binary_search(images.lost.begin(), images.lost.end(), t);
    };
    if (images.stamps.empty()) {
        if (images.image_count <= 0) return result;
        const TimeNs start = estimate.front().t + from_seconds(images.start_offset_s);
        result.expected = images.image_count;
        for (const TimedPose& row : estimate) result.estimated += row.t >= start && known(row.t);
        result.estimated =
            std::min(images.images_with_pose.value_or(result.estimated), result.expected);
        return result;
    }
    const TimeNs start = images.stamps.front() + from_seconds(images.start_offset_s);
    const TimeNs tolerance = from_seconds(images.stamp_tolerance_s);
    for (const TimeNs t : images.stamps) {
        if (t < start) continue;
        ++result.expected;
        const auto row =
            std::lower_bound(estimate.begin(), estimate.end(), t - tolerance,
                             [](const TimedPose& pose, TimeNs stamp) { return pose.t < stamp; });
        result.estimated += row != estimate.end() && row->t <= t + tolerance && known(row->t);
    }
    return result;
}

void add_warnings(const EvaluationOptions& options, Evaluation& e) {
    char text[200];
    if (!options.at_s.empty()) {
        const int asked = static_cast<int>(options.at_s.size());
        if (e.associated_poses < asked) {
            std::snprintf(text, sizeof(text), "%d of the %d times have no pose of their own near",
                          asked - e.associated_poses, asked);
            e.warnings.push_back(text);
        }
    } else if (e.associated_poses < e.estimated_poses) {
        std::snprintf(text, sizeof(text), "%d of %d poses have no truth at their time",
                      e.estimated_poses - e.associated_poses, e.estimated_poses);
        e.warnings.push_back(text);
    }
    if (e.lost_poses > 0) {
        std::snprintf(text, sizeof(text),
                      "%d of %d poses are lost, as the estimate itself says; the errors count them",
                      e.lost_poses, e.estimated_poses);
        e.warnings.push_back(text);
    }
    if (!e.gaps.empty()) {
        TimeNs longest = 0;
        for (const TruthGap& gap : e.gaps) longest = std::max(longest, gap.to - gap.from);
        std::snprintf(text, sizeof(text),
                      "the truth has %zu gap%s of more than %.3g s, the longest %.3g s, from t = "
                      "%.3f s on",
                      e.gaps.size(), e.gaps.size() == 1 ? "" : "s", e.max_gap_s,
                      to_seconds(longest), to_seconds(e.gaps.front().from));
        e.warnings.push_back(text);
    }
    const double factor = e.scale_error ? 1 + *e.scale_error : 1;
    if (e.alignment.kind != AlignmentKind::kSim3 && (factor > 5 || factor < 0.2)) {
        std::snprintf(text, sizeof(text),
                      "the estimate is %.4g times as large as the truth; check the unit of the "
                      "truth, or ask for Sim(3) if the estimate has no scale",
                      factor);
        e.warnings.push_back(text);
    }
}

void measure_poses(const std::vector<PosePair>& aligned, Evaluation& e) {
    std::vector<double> position, rotation;
    for (const PosePair& pair : aligned) {
        const PoseError error{pair.t, pair.estimate_idx, pair.estimate.p - pair.truth.p,
                              rotation_angle(pair.truth.R.transpose() * pair.estimate.R)};
        e.errors.push_back(error);
        position.push_back(error.position.norm());
        if (e.has_rotation) rotation.push_back(error.rotation);
    }
    e.position = statistics(std::move(position));
    e.rotation = statistics(std::move(rotation));
}

std::optional<AfterStart> after_start(const Evaluation& e, TimeNs first_update) {
    AfterStart result;
    std::vector<double> position, rotation;
    for (const PoseError& error : e.errors) {
        ++(error.t < first_update ? result.start_poses : result.poses);
        if (error.t < first_update) continue;
        position.push_back(error.position.norm());
        if (e.has_rotation) rotation.push_back(error.rotation);
    }
    if (result.poses == 0) return std::nullopt;
    result.position = statistics(std::move(position));
    result.rotation = statistics(std::move(rotation));
    return result;
}

std::optional<Drift> drift(const std::vector<RelativeError>& steps) {
    Drift sum;
    int count = 0;
    for (const RelativeError& r : steps) {
        if (r.translation.count == 0) continue;
        sum.translation += r.translation.count * r.translation.mean / r.mean_step;
        sum.rotation += r.rotation.count * r.rotation.mean / r.mean_step;
        count += r.translation.count;
    }
    if (count == 0) return std::nullopt;
    return Drift{sum.translation / count, sum.rotation / count};
}

void measure_steps(const std::vector<PosePair>& aligned, const EvaluationOptions& options,
                   Evaluation& e) {
    std::vector<double> distances = options.rpe_distances_m;
    if (distances.empty() && e.truth_path_length > 0)
        for (int i = 1; i <= 5; ++i) distances.push_back(0.1 * i * e.truth_path_length);
    for (double step : distances)
        e.rpe_distance.push_back(relative_error_over_distance(aligned, step));
    e.drift = drift(e.rpe_distance);
    for (double step : options.rpe_times_s)
        e.rpe_time.push_back(relative_error_over_time(aligned, step));
}

// Why normalised errors against this truth would mean nothing; empty if they do mean something.
std::string why_no_nees(const std::vector<PosePair>& pairs,
                        const std::vector<Matrix6d>& covariances,
                        const EvaluationOptions& options) {
    // A truth's world is levelled less well than its poses are known; beyond this it is not meant
    // to be level.
    constexpr double kFarOff = 2 * kDegree, kSigmas = 10;
    if (!options.truth_is_exact) return "what is compared with errs itself";
    const WorldTilt tilt = world_tilt(pairs, covariances);
    if (tilt.angle < std::max(kFarOff, kSigmas * tilt.sigma)) return "";
    char text[200];
    std::snprintf(text, sizeof(text),
                  "the truth's z axis is %.1f deg off the estimate's vertical, whose 1-sigma is "
                  "%.2f deg; it needs a truth with z up",
                  tilt.angle / kDegree, tilt.sigma / kDegree);
    return text;
}

// Errors of the body, of which the covariances are. attitudes_differ: the body is not what the
// truth tracks.
void measure_nees(std::vector<PosePair> pairs, const std::vector<Matrix6d>& covariances,
                  const EvaluationOptions& options, bool attitudes_differ, Evaluation& e) {
    const Pose T_T_B = options.T_B_T.inverse();
    for (PosePair& pair : pairs) {
        pair.estimate = pair.estimate * T_T_B;
        pair.truth = pair.truth * T_T_B;
    }
    e.no_nees = why_no_nees(pairs, covariances, options);
    if (e.no_nees.empty() && attitudes_differ)
        e.no_nees = "the attitudes are not of one body, see the note";
    if (e.no_nees.empty()) e.nees = nees(pairs, covariances);
}

}  // namespace

std::vector<TimedPose> apply(const Similarity& S_G_E, const std::vector<TimedPose>& estimate) {
    std::vector<TimedPose> aligned = estimate;
    for (TimedPose& row : aligned) row.T_W_B = S_G_E * row.T_W_B;
    return aligned;
}

Evaluation evaluate(const std::vector<TimedPose>& estimate, const std::vector<TimedPose>& truth,
                    const EvaluationOptions& options,
                    const std::optional<std::vector<Matrix6d>>& covariances) {
    check_trajectory(estimate, options.estimate_name);
    check_trajectory(truth, options.truth_name);
    if (covariances && covariances->size() != estimate.size())
        throw InputError(options.estimate_name + ": holds " + std::to_string(estimate.size()) +
                         " poses but " + std::to_string(covariances->size()) +
                         " covariances; give one for each");
    Evaluation e;
    settle_time(estimate, truth, options, e);
    std::vector<PosePair> pairs = associated_pairs(estimate, truth, options, e);
    const auto [p_E, p_G] = positions(pairs);

    e.gaps = gaps(truth, estimate, e);
    e.has_rotation = options.truth_has_attitude;
    e.estimate_name = options.estimate_name;
    e.truth_name = options.truth_name;
    e.estimated_poses = static_cast<int>(estimate.size());
    e.associated_poses = static_cast<int>(pairs.size());
    e.duration_s = to_seconds(pairs.back().t - pairs.front().t);
    e.estimate_path_length = path_length(p_E);
    e.truth_path_length = path_length(p_G);
    e.lost_poses = static_cast<int>(options.images.lost.size());
    e.completion = completion(estimate, options.images);
    if (options.estimate_has_scale) {
        // Who asks for Sim(3) may have an estimate without scale.
        if (const auto unit = other_unit(p_E, p_G)) {
            if (options.alignment != AlignmentKind::kSim3)
                throw InputError(options.estimate_name + " against " + options.truth_name + ": " +
                                 *unit);
            e.warnings.push_back(*unit);
        }
        e.scale_error = scale_error(p_E, p_G);
    }

    const std::vector<PosePair> associated = pairs;
    e.alignment = align(p_E, p_G, options.alignment);
    require_determined(e.alignment, options);
    for (PosePair& pair : pairs) pair.estimate = e.alignment.S_G_E * pair.estimate;
    measure_poses(pairs, e);
    if (options.first_update) e.after_start = after_start(e, *options.first_update);
    if (e.has_rotation) {
        measure_steps(pairs, options, e);
        const auto attitude = other_attitude(pairs, options.T_B_T.R);
        if (attitude) e.warnings.push_back(*attitude);
        if (covariances) measure_nees(associated, *covariances, options, attitude.has_value(), e);
    }
    add_warnings(options, e);
    return e;
}

}  // namespace vio
