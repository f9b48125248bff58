#include "libvio/recursive/iekf.h"

#include <cmath>
#include <utility>

#include "libvio/base/chi_square.h"
#include "libvio/recursive/iekf_impl.h"

namespace vio {

namespace {

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

Iekf::Impl::Impl(const Rig& r, const IekfOptions& o, const BatchOptions& batch, bool imu)
    : rig(checked(r)),
      stated_T_I_C(rig.T_I_C()),
      stated_offset(from_seconds(rig.time_offset)),
      options(o),
      use_imu(imu),
      queue(from_seconds(o.message_window), imu),
      prefix(rig, o, batch, imu),
      priors(batch),
      rest(rig.imu_noise, o.sigma_px),
      motion(make_motion(rig, o, imu)),
      window(window_options(rig, o), rig.camera),
      landmark_gate(chi_square_quantile(2, o.gate)) {
    prefix.set_mount(known_mount());
}

// ---- The course -------------------------------------------------------------------------------

void Iekf::Impl::take_messages(bool at_end) {
    while (const auto message = queue.pop(at_end))
        std::visit([this](const auto& m) { take(m); }, *message);
}

void Iekf::Impl::take(const ImuReading& reading) {
    if (!use_imu) return;
    if (reading.t > newest_reading) rest.add(reading);
    newest_reading = std::max(newest_reading, reading.t);
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
    if (starting() && prefix.image_missing(reading.t)) start_without_more_images();
}

void Iekf::Impl::take(const TimedFrame& image) {
    if (use_imu && image.frame.t > newest_image) rest.add(image.frame, image.t_imu);
    newest_image = std::max(newest_image, image.frame.t);
    if (!state && given_start && image.t_imu > given_time())
        begin_given(use_imu && queue.next_reading() ? *queue.next_reading() : ImuReading{});
    if (state && image.t_imu > started_at) process_image(image);
    if (starting()) try_start(image);
}

void Iekf::Impl::process_image(const TimedFrame& image) {
    after_gap = image_missing(image.frame.t);
    if (!after_gap) image_interval = to_seconds(image.frame.t - image_time);
    image_time = image.frame.t;
    innovations = {.t = image.frame.t};
    scale_correction = 0;
    take_reading_innovations();
    move_to(image.t_imu, image.frame.t);
    abandon_if_blind(image.frame.t);
    if (!abandoned) {
        sort_features(image.frame);
        update_known_points();
        drop_lost_points();
        hold_at_rest();
    }
    use_window_points();
    judge(image.frame.t);
    know_mount(state->mount());
    report(image.frame.t, used);
    if (restarting) note_coasting(image.frame.t);
    result.innovations.push_back(innovations);
    follow_keyframes(image.frame);
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

// An image that comes in time by the stated offset counts as late by no other.
void Iekf::add(const FeatureFrame& frame) {
    TimeNs t_imu = frame.t + from_seconds(impl_->rig.time_offset);
    if (const auto released = impl_->queue.released())
        t_imu = std::max(t_imu, std::min(frame.t + impl_->stated_offset, *released));
    impl_->queue.add(TimedFrame{t_imu, frame});
    impl_->take_messages(false);
}

void Iekf::finish() {
    impl_->take_messages(true);
    // A recording shorter than a prefix has at least its batch estimate.
    if (!impl_->state && !impl_->given_start && impl_->start_without_more_images())
        impl_->take_messages(true);
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
    if (!impl_->result.states.empty()) return &impl_->result.states.back();
    return impl_->last_taken ? &*impl_->last_taken : nullptr;
}

Estimate Iekf::take() {
    Estimate& result = impl_->result;
    result.landmarks.clear();
    for (const auto& [id, landmark] : impl_->landmark_estimates)
        result.landmarks.push_back(landmark);
    impl_->landmark_estimates.clear();
    if (!result.states.empty()) impl_->last_taken = result.states.back();
    Estimate taken = result;
    result.states.clear();
    result.landmarks.clear();
    result.keyframe_motions.clear();
    result.innovations.clear();
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
