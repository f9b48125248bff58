#include "libvio/simulation/scenario.h"

#include <cmath>
#include <sstream>

#include "libvio/base/angles.h"
#include "libvio/geometry/so3.h"
#include "libvio/io/sensor_text.h"
#include "libvio/io/trajectory_io.h"
#include "libvio/simulation/scenario_text.h"

namespace vio {
namespace {

constexpr TimeNs kTick = 100;  // resolution of rawlog stamps [ns]

SplineTrajectory along(const std::vector<TimedPose>& recorded, double piece) {
    std::vector<Waypoint> points;
    for (const TimedPose& pose : recorded)
        points.push_back({to_seconds(pose.t - recorded.front().t), pose.T_W_B});
    return SplineTrajectory::along(points, piece);
}

CameraPtr make_camera(const ScenarioOptions& options) {
    return options.camera.make(options.image_width, options.image_height,
                               numbers_in(options.intrinsics, "[camera] intrinsics"),
                               numbers_in(options.distortion, "[camera] distortion"));
}

Eigen::Matrix3d random_gain(double scale_sigma, double misalignment_sigma, Random& random) {
    Eigen::Matrix3d gain = Eigen::Matrix3d::Identity();
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            gain(i, j) += (i == j ? scale_sigma : misalignment_sigma) * random.normal();
    return gain;
}

// The values with normal errors, as text.
std::string with_errors(const std::string& values, const std::string& sigmas,
                        const std::string& option, Random& random) {
    std::vector<double> v = numbers_in(values, option);
    const std::vector<double> sigma = numbers_in(sigmas, option);
    if (sigma.size() > v.size())
        throw InputError("scenario " + option + ": more spreads than values");
    std::ostringstream text;
    text.precision(17);
    for (size_t i = 0; i < v.size(); ++i)
        text << v[i] + (i < sigma.size() ? sigma[i] : 0) * random.normal() << " ";
    return text.str();
}

Rig with_errors(const Rig& truth, const ScenarioOptions& options, Random& random) {
    const CalibrationErrors& errors = options.calibration;
    ScenarioOptions stated = options;
    stated.intrinsics = with_errors(options.intrinsics, errors.intrinsics_sigma,
                                    "[calibration] intrinsics_sigma", random);
    stated.distortion = with_errors(options.distortion, errors.distortion_sigma,
                                    "[calibration] distortion_sigma", random);
    const auto moved = [&](const Pose& pose, double degrees, double metres) {
        const Eigen::Vector3d turn = degrees * kDegree * random.normal3();
        return Pose{pose.R * so3::exp(turn), pose.p + metres * random.normal3()};
    };
    stated.camera = options.camera.stated();
    Rig rig = truth;
    rig.camera = make_camera(stated);
    rig.T_B_C = moved(truth.T_B_C, errors.camera_rotation_deg, errors.camera_position);
    rig.T_B_I = moved(truth.T_B_I, errors.imu_rotation_deg, errors.imu_position);
    rig.time_offset += errors.time_offset_error;
    return rig;
}

Scene make_scene(const ScenarioOptions& options) {
    SceneLayout layout;
    const auto origin = numbers_in(options.scene_origin, "[scene] origin", 3);
    const auto size = numbers_in(options.room_size, "[scene] room_size", 3);
    layout.origin = Eigen::Vector3d(origin.data());
    layout.room_size = Eigen::Vector3d(size.data());
    return Scene::make(options.scene, static_cast<std::uint64_t>(options.seed), layout);
}

// A tracker does not find its features again after the dark, nor after a long gap between images.
void interrupt(SimulatedTracks& tracks, const StreamModel& model) {
    if (tracks.frames.empty() || tracks.points_W.empty()) return;
    const TimeNs first = tracks.frames.front().t;
    FeatureId shift = 0, next = tracks.points_W.rbegin()->first + 1;
    bool before = false;
    const std::map<FeatureId, Eigen::Vector3d> points = tracks.points_W;
    for (FeatureFrame& frame : tracks.frames) {
        const bool dark = model.dark.holds(frame.t, first);
        const bool out = dark || model.no_images.holds(frame.t, first);
        if (dark) frame.features.clear();
        if (before && !out) shift += next;
        before = out;
        for (FeatureObservation& feature : frame.features) {
            feature.feature_id += shift;
            if (shift > 0)
                tracks.points_W[feature.feature_id] = points.at(feature.feature_id - shift);
        }
    }
}

TimeNs on_tick(double seconds) {
    return kTick * static_cast<TimeNs>(std::llround(seconds * (1e9 / kTick)));
}

}  // namespace

Simulation::Simulation(const ScenarioOptions& options)
    : options_(options), g_W_(0, 0, -options.gravity), scene_(make_scene(options)) {
    rig_.camera = make_camera(options);
    rig_.T_B_C = pose_option(options.camera_pose, "[camera] pose");
    rig_.T_B_I = pose_option(options.imu_pose, "[imu] pose");
    rig_.imu_noise = options.imu.noise;
    rig_.imu_noise.gyro_sensitivity_error =
        std::hypot(options.gyro_scale_sigma, options.misalignment_sigma);
    rig_.time_offset = options.time_offset_s;

    make_trajectory();
    make_image_times();
    if (options.recorded_imu_file.empty()) {
        make_imu();
        make_truth();
    } else {
        make_recorded_imu();
    }
    make_vibration();
    make_tracks();
    make_vehicle_sensors();
    make_stream();
    Random random(static_cast<std::uint64_t>(options.seed), "calibration");
    stated_rig_ = with_errors(rig_, options, random);
}

Simulation::~Simulation() = default;

TimeNs Simulation::stamp(double t) const {
    return start_ + on_tick(t);
}

double Simulation::seconds(TimeNs stamp) const {
    return to_seconds(stamp - start_);
}

void Simulation::make_trajectory() {
    if (options_.recorded_file.empty()) {
        start_ = from_seconds(options_.start_time_s);
        trajectory_ = std::make_unique<SplineTrajectory>(
            options_.motion.make(static_cast<std::uint64_t>(options_.seed)));
        return;
    }
    const std::vector<TimedPose> recorded = read_trajectory(options_.recorded_file);
    start_ = recorded.front().t / kTick * kTick;
    trajectory_ = std::make_unique<SplineTrajectory>(along(recorded, options_.recorded_piece_s));
}

void Simulation::make_image_times() {
    const double first = options_.first_image_s;
    double last = trajectory_->end();
    if (!options_.recorded_file.empty())  // nothing is known beyond its end
        last -= options_.imu_margin_s + std::abs(options_.time_offset_s) + 2 / options_.imu_rate;
    const auto full = [&] {
        return options_.image_count > 0 &&
               static_cast<int>(image_times_.size()) >= options_.image_count;
    };
    if (!options_.times_file.empty()) {
        for (const TimeNs t : read_stamps(options_.times_file)) {
            const double s = seconds(t / kTick * kTick);
            if (s >= first && s <= last && !full()) image_times_.push_back(stamp(s));
        }
    } else {
        const double end = options_.image_count > 0 ? 1e18 : last + 1e-9 / options_.image_rate;
        for (int i = 0; first + i / options_.image_rate <= end && !full(); ++i)
            image_times_.push_back(stamp(first + i / options_.image_rate));
    }
    if (image_times_.empty())
        throw InputError("scenario [camera] first_image" +
                         (options_.times_file.empty() ? "" : " and " + options_.times_file) +
                         ": no image between " + std::to_string(first) +
                         " s and the trajectory's "
                         "end (" +
                         std::to_string(last) + " s)");
}

void Simulation::make_imu() {
    const auto seed = static_cast<std::uint64_t>(options_.seed);
    Random times_random(seed, "imu times"), random(seed, "imu"), calibration(seed, "imu errors");
    const std::vector<double> times =
        imu_times(seconds(image_times_.front()) - options_.imu_margin_s,
                  seconds(image_times_.back()) + options_.imu_margin_s, options_.imu_rate,
                  options_.imu_jitter_s, times_random);
    if (!options_.motion.rests_at_ends() || !options_.recorded_file.empty())
        if (times.front() < trajectory_->begin() || times.back() > trajectory_->end())
            throw InputError("scenario [camera] first_image, count: the inertial readings from " +
                             std::to_string(times.front()) + " to " + std::to_string(times.back()) +
                             " s leave the trajectory (" + std::to_string(trajectory_->begin()) +
                             " to " + std::to_string(trajectory_->end()) +
                             " s); take fewer images");
    std::vector<double> cuts;
    for (const TimeNs t : image_times_) cuts.push_back(seconds(t));
    ideal_imu_ = vio::ideal_imu(*trajectory_, rig_.T_B_I, g_W_, times, cuts);
    ImuErrors errors = options_.imu;
    errors.initial_bias.gyro = options_.gyro_bias_sigma * calibration.normal3();
    errors.initial_bias.accel = options_.accel_bias_sigma * calibration.normal3();
    errors.gyro_gain =
        random_gain(options_.gyro_scale_sigma, options_.misalignment_sigma, calibration);
    errors.accel_gain =
        random_gain(options_.accel_scale_sigma, options_.misalignment_sigma, calibration);
    imu_ = with_errors(ideal_imu_, errors, random);
    const TimeNs shift = start_ + on_tick(options_.time_offset_s);
    for (ImuReading& reading : ideal_imu_) reading.t += shift;
    for (ImuReading& reading : imu_.readings) reading.t += shift;
}

void Simulation::make_recorded_imu() {
    if (options_.recorded_file.empty())
        throw InputError(
            "scenario [imu] recorded_file: without [trajectory] recorded_file, the "
            "path along which " +
            options_.recorded_imu_file + " was recorded");
    const ImuSequence imu(read_imu(options_.recorded_imu_file));
    Rig smoothing = rig_;
    smoothing.imu_noise.gyro_sensitivity_error = 0;
    smoothed_path_ = smooth_path(*trajectory_, seconds(image_times_.front()), image_times_, imu,
                                 smoothing, options_.gravity, options_.recorded_errors);
    rig_.imu_noise.gyro_sensitivity_error = ImuNoise{}.gyro_sensitivity_error;
    truth_ = smoothed_path_->states;
    std::vector<Waypoint> points;
    for (const StateEstimate& state : truth_) points.push_back({seconds(state.t), state.T_W_B});
    trajectory_ =
        std::make_unique<SplineTrajectory>(SplineTrajectory::through(points, CurveEnds::kFree));

    const TimeNs margin = from_seconds(options_.imu_margin_s + std::abs(options_.time_offset_s));
    auto state = truth_.begin();
    for (const ImuReading& reading : imu.readings()) {
        if (reading.t < image_times_.front() - margin || reading.t > image_times_.back() + margin)
            continue;
        while (state + 1 != truth_.end() && (state + 1)->t <= reading.t) ++state;
        imu_.readings.push_back({reading.t / kTick * kTick, reading.gyro, reading.accel});
        imu_.biases.push_back({state->gyro_bias, state->accel_bias});
    }
}

void Simulation::make_truth() {
    const TimeNs offset = on_tick(options_.time_offset_s);
    size_t reading = 0;
    for (const TimeNs t : image_times_) {
        while (reading + 1 < imu_.readings.size() && imu_.readings[reading + 1].t <= t + offset)
            ++reading;
        const Motion motion = trajectory_->at(seconds(t));
        StateEstimate state;
        state.t = t;
        state.T_W_B = motion.T_W_B;
        state.v_W = motion.v_W;
        state.gyro_bias = imu_.biases[reading].gyro;
        state.accel_bias = imu_.biases[reading].accel;
        truth_.push_back(state);
    }
}

void Simulation::make_tracks() {
    if (!options_.tracks) return;
    std::vector<Pose> T_W_C;
    for (const StateEstimate& state : truth_) T_W_C.push_back(state.T_W_B * rig_.T_B_C);
    Random random(static_cast<std::uint64_t>(options_.seed), "tracks");
    tracks_ =
        simulate_tracks(scene_, *rig_.camera, image_times_, T_W_C, options_.track_model, random);
    if (!vibrating_.empty()) apply_vibration(*rig_.camera, vibrating_, T_W_C, tracks_);
    interrupt(tracks_, options_.messages);
}

void Simulation::make_vibration() {
    std::vector<double> accelerations;
    for (const TimeNs t : image_times_)
        accelerations.push_back(trajectory_->at(seconds(t)).a_W.norm());
    Random random(static_cast<std::uint64_t>(options_.seed), "vibration");
    vibrating_ = options_.camera.vibrating(rig_.camera, accelerations, random);
}

void Simulation::make_vehicle_sensors() {
    const auto seed = static_cast<std::uint64_t>(options_.seed);
    const double begin = seconds(image_times_.front()), end = seconds(image_times_.back());
    const auto times = [&](double rate) {
        std::vector<double> all;
        for (int k = 0; begin + k / rate <= end; ++k)
            all.push_back(seconds(stamp(begin + k / rate)));
        return all;
    };
    if (options_.odometry.make) {
        Random random(seed, "odometry");
        odometry_ = simulate_odometry(*trajectory_, times(options_.odometry.rate),
                                      options_.odometry, random);
        for (OdometryMessage& message : odometry_.messages)
            message.t = stamp(to_seconds(message.t));
    }
    if (options_.gps.make) {
        Random random(seed, "gps");
        gps_ = simulate_gps(*trajectory_, times(options_.gps.rate), options_.gps, random);
        for (GpsMessage& fix : gps_.messages) fix.t = stamp(to_seconds(fix.t));
    }
}

void Simulation::make_stream() {
    std::vector<StreamEntry> entries;
    const auto add = [&](StreamEntry::Kind kind, const auto& messages, const auto& time_of) {
        for (size_t i = 0; i < messages.size(); ++i)
            entries.push_back({time_of(messages[i]), kind, static_cast<int>(i)});
    };
    const auto own_time = [](const auto& message) { return message.t; };
    using Kind = StreamEntry::Kind;
    add(Kind::kImu, imu_.readings, own_time);
    add(Kind::kOdometry, odometry_.messages, own_time);
    add(Kind::kGps, gps_.messages, own_time);
    add(Kind::kImage, image_times_, [](TimeNs t) { return t; });
    Random random(static_cast<std::uint64_t>(options_.seed), "messages");
    stream_ = arranged(std::move(entries), options_.messages, random);
}

cv::Mat Simulation::image(int image_idx) const {
    if (options_.messages.dark.holds(image_times_[image_idx], image_times_.front()))
        return cv::Mat::zeros(rig_.camera->height(), rig_.camera->width(), CV_8U);
    if (!vibrating_.empty() || !renderer_)
        renderer_ = std::make_unique<Renderer>(
            scene_, vibrating_.empty() ? rig_.camera : vibrating_[image_idx], options_.rendering);
    const auto T_W_C_at = [this](double t) { return trajectory_->at(t).T_W_B * rig_.T_B_C; };
    const std::uint64_t noise_seed =
        Random::stream_seed(static_cast<std::uint64_t>(options_.seed), "image noise") +
        static_cast<std::uint64_t>(image_idx);
    return renderer_->image(seconds(image_times_[image_idx]), T_W_C_at, mixed(noise_seed));
}

}  // namespace vio
