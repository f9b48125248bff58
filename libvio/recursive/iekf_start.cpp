// Start, restart, recovery.
#include <cstdio>

#include "libvio/geometry/alignment.h"
#include "libvio/recursive/filter_start.h"
#include "libvio/recursive/iekf_impl.h"
#include "libvio/recursive/start_at_rest.h"

namespace vio {

using Eigen::Vector3d;

TimeNs Iekf::Impl::given_time() const {
    return given_start->state.t + from_seconds(rig.time_offset);
}

void Iekf::Impl::begin_given(const ImuReading& next) {
    begin(*given_start, known_mount(),
          interpolated(last_reading.value_or(next), next, given_time()));
}

void Iekf::Impl::try_start(const TimedFrame& image) {
    prefix.add(image.frame);
    if (static_cast<int>(image.frame.features.size()) < options.min_features) {
        if (waiting) return start_from(*waiting);
        prefix.clear();  // darkness: no start from images before it to those after
        return;
    }
    // A prefix gives the points' distances too, so it goes first; but a state that coasts should
    // not wait for one.
    const bool may_rest = use_imu && options.start != "prefix" && rest.at_rest();
    if (may_rest && (restarting || options.start == "rest"))
        start_from_rest();
    else if (prefix.ready(queue.next_reading()) && !start_from_prefix(queue.next_reading()) &&
             may_rest)
        start_from_rest();
    if (state && image_idx == 0 && image.frame.t == image_time) keyframes.take(image.frame);
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
    begin_found(states, tail, known_mount(), tail.state.T_W_B, to, how);
}

bool Iekf::Impl::start_from_prefix(const ImuReading* next) {
    const TimeNs t = prefix.last_image();
    const auto start = prefix.attempt(next);
    if (!start && waiting) {
        start_from(*waiting);
        return true;
    }
    if (!start) {
        log(t, "not started: " + prefix.why() +
                   (use_imu && !rest.at_rest() ? "; not at rest: " + rest.why_not() : ""));
        if (prefix.full()) coast_from_attitude();
        prefix.retry_later();
        return false;
    }
    if (!restarting && prefix.should_wait(*start)) {
        waiting = start;
        prefix.retry_later();
        return true;
    }
    start_from(*start);
    return true;
}

// From those that have come, if there are enough. Later images could not be joined to them.
bool Iekf::Impl::start_without_more_images() {
    const bool found =
        prefix.images() >= kShortestPrefix && start_from_prefix(queue.next_reading());
    if (found && waiting) start_from(*waiting);
    if (!found) prefix.clear();
    return found;
}

// The measurements after its last image are taken once more.
void Iekf::Impl::start_from(Prefix::Start start) {
    if (!restarting) result.keyframe_motions = start.keyframe_motions;
    know_mount(start.mount.mount);
    const TimeNs tail_t = start.tail.state.t;
    Prefix::Rest after = prefix.after(tail_t, tail_t + from_seconds(rig.time_offset));
    keyframes.take(after.at);
    if (after.before) last_reading = after.before;
    std::vector<TimedFrame> images;
    for (FeatureFrame& frame : after.frames)
        images.push_back({frame.t + from_seconds(rig.time_offset), std::move(frame)});
    queue.put_back(after.readings, std::move(images));
    begin_found(start.states, start.tail, start.mount, start.states.front().T_W_B,
                start.states.front().t,
                "started from a prefix of " + std::to_string(start.states.size()) +
                    " images with " + std::to_string(start.tail.landmarks.size()) + " points");
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
        begin(continued(start->tail, first.T_W_B, joint->second), known_mount(), at);
    } else {
        for (const StateEstimate& s : start->states) coasted.insert({s.t, s});
        result.states.insert(result.states.end(), start->states.begin(), start->states.end());
        last_report = start->tail.state.t;
        begin(start->tail, known_mount(), at);
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
                             const MountEstimate& mount, const Pose& from, TimeNs from_t,
                             const std::string& how) {
    const TimeNs t = tail.state.t, t_imu = t + from_seconds(rig.time_offset);
    prefix.clear();
    waiting.reset();
    const ImuReading at = reading_at(t_imu);
    const auto joint = coasted.lower_bound(from_t);
    if (restarting && joint != coasted.end()) {
        end_keyframe();                // the chain goes on from this image with the new state
        MountEstimate turned = mount;  // a tail's position, velocity, points turn with its world
        const Eigen::Matrix3d R = align_yaw_position(from, joint->second.T_W_B).R;
        for (Eigen::Index i = 0; i < turned.with_tail.rows(); i += 3)
            if (i == kPosition || i == kVelocity || i >= 15)
                turned.with_tail.middleRows<3>(i) = (R * turned.with_tail.middleRows<3>(i)).eval();
        begin(continued(tail, from, joint->second), turned, at);
        log(t, "re" + how);
    } else {
        for (StateEstimate body : states) {
            add_mounting(body, Vector3d::Zero());
            result.states.push_back(body);
        }
        last_report = t;
        begin(tail, mount, at);
        log(t, how);
    }
    restarting = abandoned = lost = false;
    coasted.clear();
}

// What is known of the camera's mount where no prefix tells more.
MountEstimate Iekf::Impl::known_mount() const {
    MountEstimate estimate;
    estimate.mount = {rig.T_I_C(), rig.time_offset};
    if (state && state->mount_size() > 0) {
        const int at = state->mount_offset();
        estimate.covariance = state->covariance().block<kMountSize, kMountSize>(at, at);
        return estimate;
    }
    constexpr double kExact_rad = 1e-7, kExact_m = 1e-7, kExact_s = 1e-8;  // where others are not
    const double rotation = options.camera_rotation_sigma, position = options.camera_position_sigma,
                 offset = options.time_offset_sigma;
    if (!restarts() || rotation + position + offset == 0) return estimate;
    Eigen::Matrix<double, kMountSize, 1> sigma;
    sigma << Vector3d::Constant(std::max(rotation, kExact_rad)),
        Vector3d::Constant(std::max(position, kExact_m)), std::max(offset, kExact_s);
    estimate.covariance = sigma.cwiseAbs2().asDiagonal();
    return estimate;
}

void Iekf::Impl::know_mount(const CameraMount& mount) {
    rig.T_B_C = rig.T_B_I * mount.T_I_C;
    queue.shift_images(from_seconds(mount.time_offset) - from_seconds(rig.time_offset));
    rig.time_offset = mount.time_offset;
}

void Iekf::Impl::begin(const BatchTail& tail, const MountEstimate& mount, const ImuReading& at) {
    now = at;
    started_at = at.t;
    last_good = tail.state.t;
    result.g_W = tail.g_W;
    result.has_scale = use_imu;
    const Vector3d omega_I =
        use_imu ? Vector3d(at.gyro - tail.state.gyro_bias) : Vector3d(Vector3d::Zero());
    state.emplace(started(
        tail, mount, rig, *motion, at, omega_I,
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
    prefix.set_mount(known_mount());
}

void Iekf::Impl::recovered(TimeNs t) {
    log(t, "the motion is known again without a new start");
    restarting = false;
    prefix.clear();
    coasted.clear();
}

}  // namespace vio
