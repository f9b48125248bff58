// Start, restart, recovery.
#include <cstdio>

#include "libvio/recursive/filter_start.h"
#include "libvio/recursive/iekf_impl.h"
#include "libvio/recursive/start_at_rest.h"

namespace vio {

using Eigen::Vector3d;

TimeNs Iekf::Impl::given_time() const {
    return given_start->state.t + from_seconds(rig.time_offset);
}

void Iekf::Impl::begin_given(const ImuReading& next) {
    begin(*given_start, interpolated(last_reading.value_or(next), next, given_time()));
}

void Iekf::Impl::try_start(const TimedFrame& image) {
    prefix.add(image.frame);
    if (static_cast<int>(image.frame.features.size()) < options.min_features) {
        prefix.clear();  // darkness: no start from images before it to those after
        return;
    }
    // A prefix gives the points' distances too, so it goes first; but a state that coasts should
    // not wait for one.
    const bool may_rest = use_imu && options.start != "prefix" && rest.at_rest();
    if (may_rest && (restarting || options.start == "rest"))
        start_from_rest();
    else if (prefix.ready() && !start_from_prefix(queue.next_reading()) && may_rest)
        start_from_rest();
    if (state && image_idx == 0) keyframes.take(image.frame);
}

void Iekf::Impl::start_from_rest() {
    const Stillness& still = rest.stillness();
    const TimeNs from = camera_time(still.from), to = camera_time(still.to);
    const BatchTail tail = start_at_rest(still, to, rig, priors);
    std::vector<StateEstimate> states;
    for (const TimeNs t : prefix.image_times()) {
        if (t < from || t > to) continue;
        states.push_back(tail.state);
        states.back().t = t;
    }
    char how[160];
    std::snprintf(how, sizeof how, "started at rest for %.2f s, tilt known to %.2g rad",
                  still.seconds(), tilt_sigma(tail.state));
    begin_found(states, tail, tail.state.T_W_B, to, how);
}

bool Iekf::Impl::start_from_prefix(const ImuReading* next) {
    const TimeNs t = prefix.last_image();
    const auto start = prefix.attempt(next);
    if (!start) {
        log(t, "not started: " + prefix.why() +
                   (use_imu && !rest.at_rest() ? "; not at rest: " + rest.why_not() : ""));
        if (prefix.full()) coast_from_attitude();
        prefix.retry_later();
        return false;
    }
    if (!restarting) result.keyframe_motions = start->keyframe_motions;
    begin_found(start->states, start->tail, start->states.front().T_W_B, start->states.front().t,
                "started from a prefix of " + std::to_string(start->states.size()) +
                    " images with " + std::to_string(start->tail.landmarks.size()) + " points");
    return true;
}

// Where the path cannot be known for long: attitude alone, marked as lost, while a start is looked
// for. Again and again, as long as that makes the attitude more certain.
void Iekf::Impl::coast_from_attitude() {
    constexpr double kMuchBetter = 0.8;
    if (!restarts() || rest.at_rest() || (state && !abandoned)) return;
    const auto start = prefix.attitude(queue.next_reading());
    if (!start) return;
    const double tilt = tilt_sigma(start->tail.state);
    if (state && !coasted.empty() && tilt > kMuchBetter * tilt_sigma(coasted.rbegin()->second))
        return;
    const StateEstimate& first = start->states.front();
    const auto joint = coasted.lower_bound(first.t);
    const ImuReading at = reading_at(start->tail.state.t + from_seconds(rig.time_offset));
    if (restarting && joint != coasted.end()) {
        end_keyframe();
        begin(continued(start->tail, first.T_W_B, joint->second), at);
    } else {
        for (const StateEstimate& s : start->states) coasted.insert({s.t, s});
        result.states.insert(result.states.end(), start->states.begin(), start->states.end());
        last_report = start->tail.state.t;
        begin(start->tail, at);
    }
    char text[160];
    std::snprintf(text, sizeof text,
                  "attitude alone goes on, from the gyro, tilt known to %.2g rad; restarting",
                  tilt);
    log(start->tail.state.t, text);
    restarting = abandoned = lost = true;
}

ImuReading Iekf::Impl::reading_at(TimeNs t_imu) const {
    if (!last_reading) return {t_imu, Vector3d::Zero(), Vector3d::Zero()};
    const ImuReading* next = queue.next_reading();
    return interpolated(*last_reading, next ? *next : *last_reading, t_imu);
}

// Begins at tail. from: a pose of the start where its world begins, at from_t; there a restart
// joins on to the state that has coasted until then.
void Iekf::Impl::begin_found(const std::vector<StateEstimate>& states, const BatchTail& tail,
                             const Pose& from, TimeNs from_t, const std::string& how) {
    const TimeNs t = tail.state.t, t_imu = t + from_seconds(rig.time_offset);
    prefix.clear();
    const ImuReading at = reading_at(t_imu);
    const auto joint = coasted.lower_bound(from_t);
    if (restarting && joint != coasted.end()) {
        end_keyframe();  // the chain goes on from this image with the new state
        begin(continued(tail, from, joint->second), at);
        log(t, "re" + how);
    } else {
        result.states.insert(result.states.end(), states.begin(), states.end());
        last_report = t;
        begin(tail, at);
        log(t, how);
    }
    restarting = abandoned = lost = false;
    coasted.clear();
}

void Iekf::Impl::begin(const BatchTail& tail, const ImuReading& at) {
    now = at;
    started_at = at.t;
    last_good = tail.state.t;
    result.g_W = tail.g_W;
    result.has_scale = use_imu;
    const Vector3d omega_I =
        use_imu ? Vector3d(at.gyro - tail.state.gyro_bias) : Vector3d(Vector3d::Zero());
    state.emplace(started(
        tail, rig, *motion, at, omega_I,
        {options.consistency == "invariant", options.max_landmarks, options.new_point_sigma}));
    image_idx = keyframe_idx = 0;
    image_time = keyframe_time = tail.state.t;
    window.clear();
    judged.clear();
}

// The state coasts on, for the output, while another start is looked for.
void Iekf::Impl::restart(TimeNs t, const std::string& why) {
    log(t, "restarting: " + why);
    restarting = true;
    prefix.clear();
}

void Iekf::Impl::recovered(TimeNs t) {
    log(t, "the motion is known again without a new start");
    restarting = false;
    prefix.clear();
    coasted.clear();
}

}  // namespace vio
