#include "libvio/recursive/prefix.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "libvio/base/angles.h"
#include "libvio/base/chi_square.h"
#include "libvio/recursive/body_frame.h"

namespace vio {
namespace {

std::string printed(const char* format, double a, double b) {
    char text[160];
    std::snprintf(text, sizeof text, format, a, b);
    return text;
}

// Whether noise explains the changes of velocity, over stretches of kStretch, that were read. Then
// the minimum may be anywhere.
bool noise_alone(const Estimate& estimate, const ImuSequence& imu, const Rig& rig) {
    constexpr double kStretch = 0.5;  // [s]
    constexpr double kProbability = 0.999;
    const double variance = rig.imu_noise.accel_noise_density * rig.imu_noise.accel_noise_density;
    Eigen::Vector3d change = Eigen::Vector3d::Zero();
    double seconds = 0, sum = 0;
    int degrees = 0;
    for (std::size_t k = 0; k + 1 < estimate.states.size(); ++k) {
        const StateEstimate& from = estimate.states[k];
        const TimeNs offset = from_seconds(rig.time_offset), to = estimate.states[k + 1].t;
        const auto segments = imu.segments(from.t + offset, to + offset);
        if (!segments) continue;
        InertialState state;
        state.R = from.T_W_B.R * rig.T_B_I.R;
        for (const ImuSegment& segment : *segments)
            integrate(state,
                      {segment.dt, segment.gyro - from.gyro_bias, segment.accel - from.accel_bias},
                      estimate.g_W);
        change += state.v;
        seconds += to_seconds(to - from.t);
        if (seconds < kStretch) continue;
        sum += change.squaredNorm() / (variance * seconds);
        degrees += 3;
        change.setZero();
        seconds = 0;
    }
    return degrees == 0 || sum < chi_square_quantile(degrees, kProbability);
}

// Relative standard deviation of a point's distance from the last image's body.
double range_sigma(const BatchTail& tail, std::size_t i) {
    const auto at = 15 + 3 * static_cast<Eigen::Index>(i);
    const Eigen::Vector3d d = tail.landmarks[i].p_W - tail.state.T_W_B.p;
    const auto P = [&](Eigen::Index a, Eigen::Index b) {
        return tail.covariance.block<3, 3>(a, b);
    };
    const Eigen::Matrix3d C =
        P(at, at) - P(at, kPosition) - P(kPosition, at) + P(kPosition, kPosition);
    return std::sqrt(std::max(0.0, d.dot(C * d))) / d.squaredNorm();
}

// Of the points in sight, in ascending order.
std::vector<double> range_sigmas(const BatchTail& tail) {
    std::vector<double> sigmas;
    for (std::size_t i = 0; i < tail.landmarks.size(); ++i) sigmas.push_back(range_sigma(tail, i));
    std::sort(sigmas.begin(), sigmas.end());
    return sigmas;
}

}  // namespace

double tilt_sigma(const StateEstimate& state) {
    const Eigen::Matrix3d P =
        state.T_W_B.R * state.covariance.topLeftCorner<3, 3>() * state.T_W_B.R.transpose();
    return std::sqrt(std::max(P(0, 0), P(1, 1)));
}

Prefix::Prefix(const Rig& rig, const IekfOptions& options, const BatchOptions& batch, bool use_imu)
    : rig_(rig),
      options_(options),
      batch_(batch),
      use_imu_(use_imu),
      next_attempt_(options.prefix_images) {
    batch_.intrinsics_sigma = 0;
}

void Prefix::set_mount(const MountEstimate& mount) {
    constexpr double kSigmas = 5;
    mount_ = mount;
    rig_.T_B_C = rig_.T_B_I * mount.mount.T_I_C;
    rig_.time_offset = mount.mount.time_offset;
    const Eigen::VectorXd sigma = mount.covariance.diagonal().cwiseSqrt();
    const bool open = sigma.size() > 0;
    batch_.extrinsics_rotation_sigma = open ? sigma.head<3>().maxCoeff() / kDegree : 0;
    batch_.extrinsics_position_sigma = open ? sigma.segment<3>(3).maxCoeff() : 0;
    batch_.time_offset_sigma = open ? sigma(kTimeOffset) : 0;
    margin_ = from_seconds(kSigmas * batch_.time_offset_sigma);
}

void Prefix::add(const ImuReading& reading) {
    readings_.push_back(reading);
    if (frames_.empty()) drop_readings(reading.t);
}

// Those that no image from t on needs.
void Prefix::drop_readings(TimeNs t) {
    while (readings_.size() > 1 && readings_[1].t <= t - margin_) readings_.pop_front();
}

void Prefix::add(const FeatureFrame& frame) {
    const TimeNs t_imu = frame.t + from_seconds(rig_.time_offset);
    if (use_imu_ && (readings_.empty() || readings_.front().t > t_imu)) return;
    frames_.push_back(frame);
}

std::vector<TimeNs> Prefix::image_times() const {
    std::vector<TimeNs> times;
    for (const FeatureFrame& frame : frames_) times.push_back(frame.t);
    return times;
}

// An image after the last reading has waited for one in vain: there will be no more.
bool Prefix::ready(const ImuReading* next) const {
    const bool silent = use_imu_ && !next && !readings_.empty() && !frames_.empty() &&
                        frames_.back().t + from_seconds(rig_.time_offset) > readings_.back().t;
    return (silent ? images() : static_cast<int>(covered(next))) >= next_attempt_;
}

bool Prefix::image_missing(TimeNs t) const {
    constexpr double kUsualIntervals = 3, kUnknownInterval = 2;  // of a single image, [s]
    if (frames_.empty()) return false;
    const double interval = images() > 1
                                ? to_seconds(frames_.back().t - frames_[frames_.size() - 2].t)
                                : kUnknownInterval;
    const TimeNs last = frames_.back().t + from_seconds(rig_.time_offset);
    return to_seconds(t - last) > std::max(options_.lost_after_seconds, kUsualIntervals * interval);
}

// How many of the images are earlier than the last reading, wherever the time offset may put them.
std::size_t Prefix::covered(const ImuReading* next) const {
    if (margin_ == 0 || !use_imu_ || readings_.empty()) return frames_.size();
    const TimeNs last = (next ? next->t : readings_.back().t) - margin_;
    std::size_t n = frames_.size();
    while (n > 0 && frames_[n - 1].t + from_seconds(rig_.time_offset) > last) --n;
    return n;
}

void Prefix::clear() {
    gyro_bias_.reset();
    frames_.clear();
    readings_.clear();
    next_attempt_ = options_.prefix_images;
}

std::optional<Prefix::Start> Prefix::fail(std::string why) {
    why_ = std::move(why);
    return std::nullopt;
}

bool Prefix::full() const {
    return next_attempt_ + step() > 2 * options_.prefix_images;
}

void Prefix::retry_later() {
    if (!full()) {
        next_attempt_ += step();
        return;
    }
    frames_.erase(frames_.begin(), frames_.begin() + std::min(step(), images() - 1));
    drop_readings(frames_.front().t + from_seconds(rig_.time_offset));
}

// Before the first one nothing is known: there it goes on as it began, as far as the time offset
// may reach.
ImuSequence Prefix::readings(const ImuReading* next) const {
    std::vector<ImuReading> all(readings_.begin(), readings_.end());
    if (margin_ > 0 && !all.empty()) {
        all.insert(all.begin(), all.front());
        all.front().t -= margin_;
    }
    ImuSequence imu(std::move(all));
    if (next) imu.push_back(*next);
    return imu;
}

// Turning tells it from the accelerometer's bias, and a first few seconds may have had none.
bool Prefix::should_wait(const Start& start) const {
    return use_imu_ && !full() && tilt_sigma(start.tail.state) > options_.start_wanted_tilt;
}

Prefix::Rest Prefix::after(TimeNs t, TimeNs t_imu) const {
    Rest rest;
    for (const ImuReading& reading : readings_) {
        if (reading.t <= t_imu)
            rest.before = reading;
        else
            rest.readings.push_back(reading);
    }
    for (const FeatureFrame& frame : frames_) {
        if (frame.t == t) rest.at = frame;
        if (frame.t > t) rest.frames.push_back(frame);
    }
    return rest;
}

std::optional<Prefix::Start> Prefix::attempt(const ImuReading* next) {
    BatchProblem problem;
    problem.rig = rig_;
    problem.frames.assign(frames_.begin(),
                          frames_.begin() + static_cast<std::ptrdiff_t>(covered(next)));
    gyro_bias_.reset();
    BatchResult result;
    MountEstimate mount = mount_;
    try {
        if (use_imu_) problem.imu = readings(next);
        result = estimate_batch(problem, batch_, std::nullopt, true);
        if (result.rig)
            mount = {{result.rig->rig.T_I_C(), result.rig->rig.time_offset},
                     result.rig->covariance,
                     result.tail ? result.tail->with_rig : Eigen::MatrixXd()};
    } catch (const InputError& error) {
        return fail(error.what());
    }
    if (result.tail && result.tail->covariance.allFinite())
        gyro_bias_ = {result.tail->state.gyro_bias,
                      result.tail->covariance.block<3, 3>(kGyroBias, kGyroBias)};
    std::string why = why_not(result, problem.imu);
    if (!why.empty()) return fail(std::move(why));
    return Start{std::move(result.estimate.states), std::move(result.estimate.keyframe_motions),
                 std::move(*result.tail), std::move(mount)};
}

// The value that forbids to start at a result, and its limit; empty: none.
std::string Prefix::why_not(const BatchResult& result, const ImuSequence& imu) const {
    if (!result.report.converged) return "prefix not converged: " + result.report.reason;
    if (!result.tail || result.tail->landmarks.empty())
        return "prefix has no landmarks in its last image";
    if (!result.tail->covariance.allFinite()) return "prefix has no covariance";
    if (!use_imu_) return {};
    const StateEstimate& last = result.tail->state;
    const double velocity = velocity_sigma(last.T_W_B.R, last.v_W, last.covariance);
    const double limit = options_.velocity_limit(options_.start_velocity_sigma, last.v_W.norm());
    if (!(velocity <= limit))
        return printed("prefix velocity uncertain: sigma %.3g m/s, limit %.3g m/s", velocity,
                       limit);
    const double tilt = tilt_sigma(result.tail->state);
    if (!(tilt <= options_.start_tilt_sigma))
        return printed("prefix tilt uncertain: sigma %.3g rad, limit %.3g rad", tilt,
                       options_.start_tilt_sigma);
    // Far from what is stated of them they mark a false minimum. (With fixed weights their cost is
    // not in squared sigmas.)
    constexpr double kProbability = 1 - 1e-6;
    const int stated = 6 + (result.rig ? static_cast<int>(result.rig->unknowns.size()) : 0);
    const double contradiction = chi_square_quantile(stated, kProbability);
    if (batch_.weighting != "fixed" && !(result.report.prior_cost <= contradiction))
        return printed(
            "prefix biases or mount contradict what is stated of them: squared sigmas %.3g, limit "
            "%.3g",
            result.report.prior_cost, contradiction);
    if (noise_alone(result.estimate, imu, rig_))
        return "the readings' changes of velocity are no more than noise";
    if (!(result.report.scale_sigma <= options_.start_scale_sigma))
        return printed("prefix scale uncertain: sigma %.3g, limit %.3g", result.report.scale_sigma,
                       options_.start_scale_sigma);
    // Nor are errors normal where most points are too far to have a distance.
    const std::vector<double> ranges = range_sigmas(*result.tail);
    const double range = ranges[ranges.size() / 4];
    if (!(range <= options_.new_point_sigma))
        return printed("three of four points' distances uncertain: sigma %.3g and more, limit %.3g",
                       range, options_.new_point_sigma);
    return {};
}

std::optional<AttitudeStart> Prefix::attitude(const ImuReading* next) const {
    const std::vector<FeatureFrame> frames(frames_.begin(), frames_.end());
    const ImuSequence imu = readings(next);
    const TimeNs offset = from_seconds(rig_.time_offset);
    if (frames.size() < 2 || !imu.covers(frames.front().t + offset, frames.back().t + offset))
        return std::nullopt;
    GyroBias bias;
    bias.covariance.diagonal().setConstant(batch_.gyro_bias_sigma * batch_.gyro_bias_sigma);
    if (const auto seen = gyro_bias_of_rotation(frames, imu, rig_, options_.sigma_px))
        bias = *seen;
    else if (gyro_bias_)
        bias = *gyro_bias_;
    return start_of_attitude(frames, imu, bias, rig_, batch_);
}

}  // namespace vio
