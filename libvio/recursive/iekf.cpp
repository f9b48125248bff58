#include "libvio/recursive/iekf.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <deque>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "libvio/geometry/relative_pose.h"
#include "libvio/recursive/body_frame.h"
#include "libvio/recursive/filter_start.h"
#include "libvio/recursive/landmark_update.h"
#include "libvio/recursive/message_queue.h"
#include "libvio/recursive/motion.h"
#include "libvio/recursive/prefix.h"
#include "libvio/recursive/rest.h"
#include "libvio/recursive/rest_update.h"
#include "libvio/recursive/start_at_rest.h"
#include "libvio/recursive/window.h"
#include "libvio/tracking/keyframes.h"

namespace vio {

using Eigen::Vector3d;

namespace {

constexpr int kShortestPrefix = 3;      // images
constexpr int kMaxRejections = 3;       // consecutive, then a landmark is given up
constexpr int kMaxBadImages = 3;        // consecutive, then all landmarks are
constexpr double kBadShare = 0.5;       // of an image's landmarks passing the gate
constexpr int kJudgedImages = 10;       // over which the share of passing landmarks is judged,
constexpr int kJudgedSights = 30;       // if there are so many
constexpr double kLongestBridge = 0.1;  // [s] without readings that is not worth a word
// What is added to the core's uncertainty when most landmarks contradict it.
constexpr double kLostRotation = 0.1, kLostPosition = 1.0, kLostVelocity = 1.0;  // and for long
constexpr double kDoubtRotation = 0.02, kDoubtPosition = 0.05, kDoubtVelocity = 0.2;

CoreVector core_variances(const FilterState& state, double rotation, double position,
                          double velocity) {
    CoreVector variances = CoreVector::Zero(state.core_size());
    variances.segment<3>(kRotation).setConstant(rotation * rotation);
    variances.segment<3>(kPosition).setConstant(position * position);
    if (state.core_size() > kVelocity)
        variances.segment<3>(kVelocity).setConstant(velocity * velocity);
    return variances;
}

std::unique_ptr<MotionModel> make_motion(const Rig& rig, const IekfOptions& options, bool use_imu) {
    const SmoothnessVariances variances{
        options.angular_rate_variance, options.acceleration_variance,
        options.image_rotation_variance, options.image_position_variance};
    constexpr double kGravitySigma = 0.02;  // [m/s^2], over the Earth and its local anomalies
    if (!use_imu) return make_image_only_motion(variances);
    if (options.motion == "smooth")
        return make_smooth_motion(rig.imu_noise, variances, kGravitySigma);
    return make_imu_driven_motion(rig.imu_noise);
}

WindowOptions window_options(const Rig& rig, const IekfOptions& options) {
    WindowOptions window;
    window.cameras_exact = options.new_points == "paper";
    window.max_landmarks = options.max_landmarks;
    window.max_points = options.max_window_points;
    window.new_point_sigma = options.new_point_sigma;
    window.gate = options.gate;
    window.angular_sigma = options.sigma_px * rig.camera->angular_resolution();
    return window;
}

Rig checked(Rig rig) {
    if (!rig.camera)
        throw InputError("recursive estimator: the rig has no camera; give a camera calibration");
    if (!std::isfinite(rig.time_offset)) rig.time_offset = 0;
    return rig;
}

}  // namespace

struct Iekf::Impl {
    Impl(const Rig& r, const IekfOptions& o, const BatchOptions& batch, bool imu)
        : rig(checked(r)),
          options(o),
          use_imu(imu),
          T_I_C(rig.T_I_C()),
          queue(from_seconds(o.message_window), imu),
          prefix(rig, o, batch, imu),
          priors(batch),
          rest(rig.imu_noise, o.sigma_px),
          motion(make_motion(rig, o, imu)),
          window(window_options(rig, o), rig.camera, T_I_C),
          landmark_gate(chi_square_quantile(2, o.gate)) {}

    // ---- The course ----------------------------------------------------------------------------

    void take_messages(bool at_end);
    void take(const ImuReading& reading);
    void take(const TimedFrame& image);

    void process_image(const TimedFrame& image) {
        image_time = image.frame.t;
        move_to(image.t_imu);
        abandon_if_blind(image.frame.t);
        if (!abandoned) {
            sort_features(image.frame);
            update_known_points();
            drop_lost_points();
            hold_at_rest();
        }
        use_window_points();
        judge(image.frame.t);
        report(image.frame.t, used);
        follow_keyframes(image.frame);
    }

    // ---- Steps ---------------------------------------------------------------------------------

    TimeNs given_time() const;
    void begin_given(const ImuReading& next);
    bool starting() const { return (!state && !given_start) || restarting; }
    void try_start(const TimedFrame& image);
    void start_from_rest();
    bool start_from_prefix(const ImuReading* next);
    void begin_found(const std::vector<StateEstimate>& states, const BatchTail& tail,
                     const Pose& from, TimeNs from_t, const std::string& how);
    void begin(const BatchTail& tail, const ImuReading& at);
    void restart(TimeNs t, const std::string& why);
    void recovered(TimeNs t);
    void move_to(TimeNs t_imu);
    void sort_features(const FeatureFrame& frame);
    void update_known_points();
    void drop_lost_points();
    void hold_at_rest();
    void use_window_points();
    void release(int slot);
    bool unseen(TimeNs t) const { return to_seconds(t - last_good) > options.lost_after_seconds; }
    double velocity_sigma() const;
    std::string velocity_known(double limit) const;
    bool restarts() const { return use_imu && options.motion == "imu_driven"; }
    void abandon_if_blind(TimeNs t);
    void abandon(TimeNs t, const std::string& why);
    bool contradicts();
    void judge(TimeNs t);
    void report(TimeNs t, int features);
    void follow_keyframes(const FeatureFrame& frame);
    void end_keyframe();
    void note_landmark(int idx);
    void give_up(const std::vector<bool>& remove);
    void log(TimeNs t, std::string text) { status.push_back({t, std::move(text)}); }
    TimeNs camera_time(TimeNs t_imu) const { return t_imu - from_seconds(rig.time_offset); }

    Rig rig;
    IekfOptions options;
    bool use_imu;
    Pose T_I_C;
    MessageQueue<> queue;
    Prefix prefix;
    BatchOptions priors;
    RestDetector rest;
    std::unique_ptr<MotionModel> motion;
    Window window;
    double landmark_gate;

    std::optional<FilterState> state;      // once started
    std::optional<BatchTail> given_start;  // until readings reach it
    std::optional<ImuReading> last_reading;
    ImuReading now;  // of the state's time
    TimeNs started_at = 0;
    int image_idx = 0;
    KeyframeSelector keyframes;
    int keyframe_idx = 0;  // image of the last key-frame
    TimeNs image_time = 0, keyframe_time = 0;

    // Of the image in work.
    std::vector<LandmarkSight> known;
    int used = 0;
    bool contradicted = false;
    std::vector<FeatureId> rejected;  // not yet taken by the caller

    // Health.
    struct Sights {
        int known, passed;
    };
    std::deque<Sights> judged;  // of the last images
    bool restarting = false;    // a new start is being looked for while the state coasts
    bool abandoned = false;     // and images contradict the state: it is not updated
    std::map<TimeNs, StateEstimate> coasted;  // while restarting, at images
    int bad_images = 0;
    TimeNs last_good = 0;
    TimeNs gap_told = 0;  // reading after which there was a gap
    bool lost = false;

    TimeNs last_report = std::numeric_limits<TimeNs>::min();
    Estimate result;
    std::map<FeatureId, LandmarkEstimate> landmark_estimates;
    std::vector<StatusEntry> status;
};

void Iekf::Impl::take_messages(bool at_end) {
    while (const auto message = queue.pop(at_end))
        std::visit([this](const auto& m) { take(m); }, *message);
}

void Iekf::Impl::take(const ImuReading& reading) {
    if (!use_imu) return;
    rest.add(reading);
    if (!state && given_start && reading.t >= given_time()) begin_given(reading);
    if (state) {
        const double interval = to_seconds(reading.t - (last_reading ? last_reading->t : now.t));
        motion->advance(*state, now, reading, interval);
        motion->measure(*state, reading, interval);
        now = reading;
        if (options.output == "readings") report(camera_time(reading.t), 0);
    }
    if (starting()) prefix.add(reading);
    last_reading = reading;
}

void Iekf::Impl::take(const TimedFrame& image) {
    if (use_imu) rest.add(image.frame, image.t_imu);
    if (!state && given_start && image.t_imu > given_time())
        begin_given(use_imu && queue.next_reading() ? *queue.next_reading() : ImuReading{});
    if (state && image.t_imu > started_at) process_image(image);
    if (starting()) try_start(image);
}

// ---- Start ------------------------------------------------------------------------------------

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
        return false;
    }
    if (!restarting) result.keyframe_motions = start->keyframe_motions;
    begin_found(start->states, start->tail, start->states.front().T_W_B, start->states.front().t,
                "started from a prefix of " + std::to_string(start->states.size()) +
                    " images with " + std::to_string(start->tail.landmarks.size()) + " points");
    return true;
}

// Begins at tail. from: a pose of the start where its world begins, at from_t; there a restart
// joins on to the state that has coasted until then.
void Iekf::Impl::begin_found(const std::vector<StateEstimate>& states, const BatchTail& tail,
                             const Pose& from, TimeNs from_t, const std::string& how) {
    const TimeNs t = tail.state.t, t_imu = t + from_seconds(rig.time_offset);
    prefix.clear();
    ImuReading at{t_imu, Vector3d::Zero(), Vector3d::Zero()};
    if (last_reading) {
        const ImuReading* next = queue.next_reading();
        at = interpolated(*last_reading, next ? *next : *last_reading, t_imu);
    }
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

// ---- Steps ------------------------------------------------------------------------------------

void Iekf::Impl::move_to(TimeNs t_imu) {
    ImuReading at{t_imu, now.gyro, now.accel};
    if (use_imu && queue.next_reading()) {
        at = interpolated(now, *queue.next_reading(), t_imu);
    }
    const TimeNs before = last_reading ? last_reading->t : now.t;
    const ImuReading* next = queue.next_reading();
    const double interval = to_seconds((next ? next->t : t_imu) - before);
    if (use_imu && interval > kLongestBridge && before != gap_told) {
        log(camera_time(t_imu), "no inertial readings for more than " +
                                    std::to_string(kLongestBridge).substr(0, 3) + " s");
        gap_told = before;
    }
    motion->advance(*state, now, at, interval);
    now = at;
    state->settle();
    state->clone(++image_idx);
}

void Iekf::Impl::sort_features(const FeatureFrame& frame) {
    std::map<FeatureId, int> landmark_of;
    for (int i = 0; i < static_cast<int>(state->landmarks().size()); ++i) {
        landmark_of[state->landmarks()[i].id] = i;
        ++state->landmark(i).images_unseen;
    }
    known.clear();
    for (const FeatureObservation& feature : frame.features) {
        const auto sight = make_sight(feature, options.sigma_px);
        if (!sight) continue;
        const auto landmark = landmark_of.find(feature.feature_id);
        if (landmark == landmark_of.end()) {
            window.observe(feature.feature_id, image_idx, *sight);
        } else {
            state->landmark(landmark->second).images_unseen = 0;
            known.push_back({landmark->second, *sight});
        }
    }
}

void Iekf::Impl::update_known_points() {
    const auto gated = [&] {
        return gated_sights(*state, known, *rig.camera, T_I_C, landmark_gate);
    };
    std::vector<LandmarkSight> passed = gated();
    const auto too_few = [&] {
        return static_cast<int>(known.size()) >= options.min_features &&
               static_cast<double>(passed.size()) < kBadShare * static_cast<double>(known.size());
    };
    contradicted = too_few();
    if (contradicted) {  // perhaps the prediction is to blame: believe it less
        state->inflate(core_variances(*state, kDoubtRotation, kDoubtPosition, kDoubtVelocity));
        passed = gated();
    }
    const bool hopeless = contradicted && too_few();
    judged.push_back({static_cast<int>(known.size()), static_cast<int>(passed.size())});
    if (static_cast<int>(judged.size()) > kJudgedImages) judged.pop_front();
    if (hopeless) passed.clear();
    std::set<int> passed_idx;
    for (const LandmarkSight& s : passed) passed_idx.insert(s.landmark_idx);
    for (const LandmarkSight& s : known) {
        LandmarkState& landmark = state->landmark(s.landmark_idx);
        const bool good = passed_idx.count(s.landmark_idx) > 0;
        landmark.rejections = good ? 0 : landmark.rejections + 1;
        landmark.observations += good;
    }
    if (!passed.empty())
        update_landmarks(*state, passed, *rig.camera, T_I_C, options.max_iterations);
    used = static_cast<int>(passed.size());
}

void Iekf::Impl::drop_lost_points() {
    std::vector<bool> remove;
    for (const LandmarkState& landmark : state->landmarks()) {
        const bool given_up = landmark.rejections >= kMaxRejections;
        if (given_up) rejected.push_back(landmark.id);
        remove.push_back(given_up || landmark.images_unseen > options.lost_after ||
                         !landmark.point.in_front());
    }
    give_up(remove);
}

// The clone of this image was made where that of the last one was.
void Iekf::Impl::hold_at_rest() {
    const int before = state->find_clone(image_idx - 1);
    if (!use_imu || !rest.at_rest() || before < 0) return;
    update_at_rest(*state, before, options.gate);
}

void Iekf::Impl::use_window_points() {
    int oldest = -1, alive = 0;
    for (const ClonedPose& clone : state->clones()) {
        if (clone.image_idx < 0) continue;
        ++alive;
        if (oldest < 0 || clone.image_idx < oldest) oldest = clone.image_idx;
    }
    const bool full = alive > options.clones;
    if (abandoned)
        used = 0;
    else
        used += window.use(*state, image_idx, full ? oldest : -1).used;
    if (full) {
        window.forget_image(oldest);
        release(state->find_clone(oldest));
    }
}

// The landmarks that are anchored there move to the newest clone.
void Iekf::Impl::release(int slot) {
    const int newest = state->find_clone(image_idx);
    for (int i = 0; i < static_cast<int>(state->landmarks().size()); ++i) {
        const LandmarkState& landmark = state->landmarks()[i];
        if (landmark.anchor != slot) continue;
        state->reanchor(i, newest,
                        moved_anchor(landmark.point, state->clones()[slot].T_W_I,
                                     state->clones()[newest].T_W_I, T_I_C));
    }
    state->release_clone(slot);
}

void Iekf::Impl::judge(TimeNs t) {
    bad_images = contradicted && used < options.min_features ? bad_images + 1 : 0;
    if (bad_images == 1) log(t, "most points contradict the state; coasting");
    if (bad_images == kMaxBadImages) {
        log(t, "points given up");
        give_up(std::vector<bool>(state->landmarks().size(), true));
        window.clear();
    }
    if (used >= options.min_features) last_good = t;
    const bool unsure = velocity_sigma() > options.lost_velocity_sigma;
    const bool now_lost = unseen(t) || unsure || abandoned;
    const auto why = [&] { return velocity_known(options.lost_velocity_sigma); };
    if (now_lost != lost)
        log(t, !now_lost ? "tracking found again"
               : unseen(t)
                   ? "tracking lost: fewer than " + std::to_string(options.min_features) +
                         " points used for " + std::to_string(options.lost_after_seconds) + " s"
                   : "tracking lost: " + why());
    lost = now_lost;
    if (!restarts()) return;
    if (restarting && !abandoned && !lost) return recovered(t);
    if (!abandoned && contradicts()) {
        abandon(t, "most points have contradicted the state for a while");
        state->inflate(core_variances(*state, kLostRotation, kLostPosition, kLostVelocity));
    } else if (unsure && !restarting) {
        restart(t, why());
    }
}

// Coasting without points can make the state so uncertain that updates would be linearised far from
// the truth, and believe in their errors.
void Iekf::Impl::abandon_if_blind(TimeNs t) {
    if (restarts() && !abandoned && unseen(t) && velocity_sigma() > options.blind_velocity_sigma)
        abandon(t, "no points in sight, " + velocity_known(options.blind_velocity_sigma));
}

// From now on the state is not updated, until there is a new start.
void Iekf::Impl::abandon(TimeNs t, const std::string& why) {
    if (!restarting) restart(t, why);
    abandoned = lost = true;
    give_up(std::vector<bool>(state->landmarks().size(), true));
    window.clear();
}

std::string Iekf::Impl::velocity_known(double limit) const {
    char text[160];
    std::snprintf(text, sizeof text, "velocity known to %.2g m/s, limit %.2g m/s", velocity_sigma(),
                  limit);
    return text;
}

// Largest standard deviation of the velocity's components [m/s].
double Iekf::Impl::velocity_sigma() const {
    if (!use_imu) return 0;
    return std::sqrt(state->core_covariance().diagonal().segment<3>(kVelocity).maxCoeff());
}

// Whether most landmarks of the last images have failed the gate.
bool Iekf::Impl::contradicts() {
    int all = 0, passed = 0;
    for (const Sights& image : judged) {
        all += image.known;
        passed += image.passed;
    }
    return all >= kJudgedSights && passed < kBadShare * all;
}

// Adds the state to the result, once for each time.
void Iekf::Impl::report(TimeNs t, int features) {
    if (t <= last_report) return;
    last_report = t;
    const Vector3d omega_I = !use_imu ? Vector3d(Vector3d::Zero())
                             : state->core_size() == static_cast<int>(CoreKind::smooth)
                                 ? state->core().omega_I
                                 : Vector3d(now.gyro - state->core().gyro_bias);
    Matrix15d J;
    StateEstimate out = body_state(state->core(), rig.T_B_I.inverse(), omega_I, &J);
    out.t = t;
    const int c = std::min(15, state->core_size());
    out.covariance.topLeftCorner(c, c) = state->core_covariance().topLeftCorner(c, c);
    out.covariance = (J * out.covariance * J.transpose()).eval();
    out.covariance = (0.5 * (out.covariance + out.covariance.transpose())).eval();
    out.lost = lost;
    out.features = features;
    result.states.push_back(out);
    if (restarting) {
        coasted.insert({t, out});
        while (static_cast<int>(coasted.size()) > 4 * options.prefix_images)
            coasted.erase(coasted.begin());
    }
    if (state->core_size() > kGravity) {
        result.g_W = state->core().g_W;
        result.gravity_covariance = state->core_covariance().block<3, 3>(kGravity, kGravity);
    }
}

// A new key-frame where the image shows too little of the last one, and before the last one's clone
// is released: the motion between them then follows from the joint covariance of their clones.
void Iekf::Impl::follow_keyframes(const FeatureFrame& frame) {
    if (!keyframes.wants(frame) && image_idx - keyframe_idx < options.clones - 1) return;
    keyframes.take(frame);
    end_keyframe();
}

void Iekf::Impl::end_keyframe() {
    const int a = state->find_clone(keyframe_idx), b = state->find_clone(image_idx);
    if (a >= 0 && b >= 0 && a != b) {
        const Pose T_I_B = rig.T_B_I.inverse();
        const Pose &A = state->clones()[a].T_W_I, &B = state->clones()[b].T_W_I;
        const RelativePose relative = relative_pose(A * T_I_B, B * T_I_B);
        Eigen::Matrix<double, 6, 12> J = relative.J;
        J.leftCols<6>() = (J.leftCols<6>() * right_compose_jacobian(A, T_I_B)).eval();
        J.rightCols<6>() = (J.rightCols<6>() * right_compose_jacobian(B, T_I_B)).eval();
        const auto P_all = state->covariance();
        const int at[2] = {state->clone_offset(a), state->clone_offset(b)};
        Eigen::Matrix<double, 12, 12> P;
        for (int r = 0; r < 2; ++r)
            for (int c = 0; c < 2; ++c)
                P.block<6, 6>(6 * r, 6 * c) = P_all.block<6, 6>(at[r], at[c]);
        result.keyframe_motions.push_back(
            {keyframe_time, image_time, relative.T_A_B, J * P * J.transpose()});
    }
    keyframe_idx = image_idx;
    keyframe_time = image_time;
}

// Notes a landmark's estimate for the result.
void Iekf::Impl::note_landmark(int i) {
    const LandmarkState& landmark = state->landmarks()[i];
    if (!landmark.point.in_front()) return;
    const PlacedPoint place = placed(landmark.point, state->clones()[landmark.anchor].T_W_I, T_I_C);
    Eigen::Matrix<double, 3, 9> G;
    G << place.J_rotation, Eigen::Matrix3d::Identity(), place.J_point;
    const int anchor = state->clone_offset(landmark.anchor), at = state->landmark_offset(i);
    const auto P_all = state->covariance();
    Eigen::Matrix<double, 9, 9> P;
    P << P_all.block<6, 6>(anchor, anchor), P_all.block<6, 3>(anchor, at),
        P_all.block<3, 6>(at, anchor), P_all.block<3, 3>(at, at);
    landmark_estimates[landmark.id] = {landmark.id, place.p_W, G * P * G.transpose(),
                                       landmark.observations};
}

// Takes landmarks out of the state.
void Iekf::Impl::give_up(const std::vector<bool>& remove) {
    for (std::size_t i = 0; i < remove.size(); ++i)
        if (remove[i]) note_landmark(static_cast<int>(i));
    state->marginalise(remove);
}

// ---- Public face ------------------------------------------------------------------------------

Iekf::Iekf(const Rig& rig, const IekfOptions& options, const BatchOptions& prefix_options,
           bool use_imu)
    : impl_(std::make_unique<Impl>(rig, options, prefix_options, use_imu)) {}

Iekf::~Iekf() = default;

void Iekf::start(const BatchTail& tail) {
    impl_->given_start = tail;
}

void Iekf::add(const ImuReading& reading) {
    impl_->queue.add(reading);
    impl_->take_messages(false);
}

void Iekf::add(const FeatureFrame& frame) {
    impl_->queue.add(TimedFrame{frame.t + from_seconds(impl_->rig.time_offset), frame});
    impl_->take_messages(false);
}

void Iekf::finish() {
    impl_->take_messages(true);
    // A recording shorter than a prefix has at least its batch estimate.
    if (!impl_->state && !impl_->given_start && impl_->prefix.images() >= kShortestPrefix)
        impl_->start_from_prefix(nullptr);
    if (impl_->state) {
        impl_->state->settle();
        impl_->end_keyframe();
        impl_->give_up(std::vector<bool>(impl_->state->landmarks().size(), true));
    }
    const auto& queue = impl_->queue;
    if (queue.late() + queue.repeated() > 0)
        impl_->log(impl_->camera_time(impl_->now.t),
                   std::to_string(queue.late()) + " measurements came too late and " +
                       std::to_string(queue.repeated()) + " twice; they were dropped");
}

const Estimate& Iekf::estimate() const {
    Estimate& result = impl_->result;
    const int in_state = impl_->state ? static_cast<int>(impl_->state->landmarks().size()) : 0;
    for (int i = 0; i < in_state; ++i) impl_->note_landmark(i);
    result.landmarks.clear();
    for (const auto& [id, landmark] : impl_->landmark_estimates)
        result.landmarks.push_back(landmark);
    return result;
}

const StateEstimate* Iekf::newest() const {
    return impl_->result.states.empty() ? nullptr : &impl_->result.states.back();
}

Estimate Iekf::take() {
    Estimate& result = impl_->result;
    result.landmarks.clear();
    for (const auto& [id, landmark] : impl_->landmark_estimates)
        result.landmarks.push_back(landmark);
    impl_->landmark_estimates.clear();
    Estimate taken = result;
    result.states.clear();
    result.landmarks.clear();
    result.keyframe_motions.clear();
    return taken;
}

std::vector<FeatureId> Iekf::take_rejected() {
    return std::exchange(impl_->rejected, {});
}

const FilterState* Iekf::state() {
    if (!impl_->state) return nullptr;
    impl_->state->settle();
    return &*impl_->state;
}

const std::vector<StatusEntry>& Iekf::status() const {
    return impl_->status;
}

}  // namespace vio
