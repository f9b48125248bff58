#include "libvio/simulation/scenario.h"

#include <array>
#include <cmath>
#include <filesystem>

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

// Loads the included file, then this one.
void load(const std::string& ini_file, OptionSet& set, ScenarioOptions& options, int depth) {
    constexpr int kDeepest = 8;
    if (depth > kDeepest)
        throw InputError(ini_file + " [scenario] include: files include each other");
    const std::filesystem::path folder = std::filesystem::path(ini_file).parent_path();
    const auto load_this = [&] {
        const std::array files{&options.recorded_file, &options.recorded_imu_file,
                               &options.times_file};
        std::array<std::string, files.size()> before;
        for (size_t i = 0; i < files.size(); ++i) before[i] = *files[i];
        set.load(ini_file);
        for (size_t i = 0; i < files.size(); ++i)
            if (!files[i]->empty() && *files[i] != before[i])
                *files[i] = (folder / *files[i]).string();
    };
    const ScenarioOptions fresh = options;
    load_this();
    if (options.include.empty()) return;
    const std::string included = (folder / options.include).string();
    options = fresh;
    load(included, set, options, depth + 1);
    load_this();
    options.include.clear();
}

Scene make_scene(const ScenarioOptions& options) {
    SceneLayout layout;
    const auto origin = numbers_in(options.scene_origin, "[scene] origin", 3);
    const auto size = numbers_in(options.room_size, "[scene] room_size", 3);
    layout.origin = Eigen::Vector3d(origin.data());
    layout.room_size = Eigen::Vector3d(size.data());
    return Scene::make(options.scene, static_cast<std::uint64_t>(options.seed), layout);
}

TimeNs on_tick(double seconds) {
    return kTick * static_cast<TimeNs>(std::llround(seconds * (1e9 / kTick)));
}

}  // namespace

void ScenarioOptions::describe(OptionSet& set) {
    set.section("scenario");
    set.add("name", &name, "title");
    set.add("include", &include,
            "another scenario file whose values hold where this one gives none; relative to this "
            "file's folder");
    set.add("seed", &seed, "-", {0, 1e9}, "seed of everything that is random");
    set.add("start_time", &start_time_s, "s", {0, 2e9}, "UNIX time at the trajectory's t = 0");
    set.add("gravity", &gravity, "m/s^2", {0, 20}, "acceleration of gravity, along -z of W");

    motion.describe(set);
    set.add(
        "recorded_file", &recorded_file,
        "instead of waypoints: TUM text or EuRoC ground truth to move along, t = 0 at its first "
        "pose; relative to this file's folder");
    set.add("recorded_piece", &recorded_piece_s, "s", {1e-3, 10},
            "length of the spline pieces fitted to recorded_file; longer is smoother");
    set.add("recorded_rotation_error", &recorded_errors.rotation, "rad", {1e-6, 1},
            "error of the poses in recorded_file, within which they give way to [imu] "
            "recorded_file");
    set.add("recorded_position_error", &recorded_errors.position, "m", {1e-6, 10},
            "the same of the positions");

    set.section("camera");
    camera.describe(set);
    set.add("width", &image_width, "px", {8, 8192}, "image width");
    set.add("height", &image_height, "px", {8, 8192}, "image height");
    set.add("intrinsics", &intrinsics,
            "fx fy [px; fisheye px/rad, parabolic_mirror px/m] cx cy [px]");
    set.add("distortion", &distortion,
            "k1 k2 p1 p2 [k3 [k4 k5 k6]] [-], in OpenCV's order; fisheye: k1 k2 k3 k4");
    set.add("pose", &camera_pose,
            "x y z yaw pitch roll [m, deg] of the camera in the body (T_B_C)");
    set.add("rate", &image_rate, "Hz", {0.01, 1000}, "images per second");
    set.add("first_image", &first_image_s, "s", {-1e6, 1e6}, "trajectory time of the first image");
    set.add("count", &image_count, "-", {0, 1e6}, "number of images; 0: to the trajectory's end");
    set.add("times_file", &times_file,
            "instead of rate: stamps of the images [ns], one a line, on the clock of [trajectory] "
            "recorded_file");

    set.section("images");
    set.add("render", &render, "draw images");
    set.add("samples", &rendering.samples, "-", {1, 8}, "rays per pixel and axis");
    set.add("exposure", &rendering.exposure, "s", {0, 1}, "exposure time; its middle is stamped");
    set.add("read_noise", &rendering.read_noise, "grey levels", {0, 100},
            "noise in the dark, 1 sigma");
    set.add("shot_noise", &rendering.shot_noise, "grey levels", {0, 100},
            "noise at white, 1 sigma");
    set.add("vignetting", &rendering.vignetting, "-", {0, 1}, "loss of light in the corners");
    set.add("row_fill", &rendering.row_fill, "-", {0, 1},
            "sensitive share of a row's height; 0.5: one field of an interlaced image");
    set.add("grey_step", &rendering.grey_step, "grey levels", {1, 64}, "quantisation of intensity");

    set.section("scene");
    set.add("kind", &scene, Scene::kinds(), "what there is to see");
    set.add("origin", &scene_origin, "x y z [m] of the scene's origin in W");
    set.add("room_size", &room_size, "length along x and y and height of kind = room [m]");

    set.section("imu");
    set.add("pose", &imu_pose, "x y z yaw pitch roll [m, deg] of the IMU in the body (T_B_I)");
    set.add("recorded_file", &recorded_imu_file,
            "instead of simulated readings: rows t[ns], gyro x y z [rad/s], accelerometer x y z "
            "[m/s^2], as in EuRoC's imu0/data.csv, taken along [trajectory] recorded_file");
    set.add("rate", &imu_rate, "Hz", {1, 10000}, "readings per second");
    set.add("jitter", &imu_jitter_s, "s", {0, 1}, "irregularity of the stamps, 1 sigma");
    set.add("margin", &imu_margin_s, "s", {0, 100},
            "readings begin and end this long before and after the images");
    set.add("time_offset", &time_offset_s, "s", {-10, 10}, "t_imu = t_cam + time_offset");
    set.add("gyro_noise_density", &imu.noise.gyro_noise_density, "rad/s/sqrt(Hz)", {0, 1},
            "white noise");
    set.add("accel_noise_density", &imu.noise.accel_noise_density, "m/s^2/sqrt(Hz)", {0, 10},
            "white noise");
    set.add("gyro_bias_random_walk", &imu.noise.gyro_bias_random_walk, "rad/s^2/sqrt(Hz)", {0, 1},
            "random walk of the bias");
    set.add("accel_bias_random_walk", &imu.noise.accel_bias_random_walk, "m/s^3/sqrt(Hz)", {0, 10},
            "random walk of the bias");
    set.add("gyro_bias_sigma", &gyro_bias_sigma, "rad/s", {0, 1},
            "spread of the bias at the start, per axis");
    set.add("accel_bias_sigma", &accel_bias_sigma, "m/s^2", {0, 10},
            "spread of the bias at the start, per axis");
    set.add("gyro_scale_sigma", &gyro_scale_sigma, "-", {0, 0.5},
            "spread of the gyro's scale factors");
    set.add("accel_scale_sigma", &accel_scale_sigma, "-", {0, 0.5},
            "spread of the accelerometer's scale factors");
    set.add("misalignment_sigma", &misalignment_sigma, "rad", {0, 0.5},
            "spread of the misalignment of both sensors' axes");
    set.add("gyro_limit", &imu.gyro_limit, "rad/s", {0, 1000}, "saturation per axis; 0: none");
    set.add("accel_limit", &imu.accel_limit, "m/s^2", {0, 10000}, "saturation per axis; 0: none");
    set.add("gyro_step", &imu.gyro_step, "rad/s", {0, 1}, "quantisation; 0: none");
    set.add("accel_step", &imu.accel_step, "m/s^2", {0, 10}, "quantisation; 0: none");

    set.section("tracks");
    set.add("make", &tracks, "make feature tracks, true places plus the errors below");
    set.add("most", &track_model.most, "-", {0, 1e5}, "features after extraction");
    set.add("fewest", &track_model.fewest, "-", {0, 1e5},
            "with fewer in sight, new ones are extracted");
    set.add("spacing", &track_model.spacing_px, "px", {0, 1e4}, "least distance of new features");
    set.add("border", &track_model.border_px, "px", {0, 1e4},
            "features this near the edge are lost");
    set.add("noise", &track_model.noise_px, "px", {0, 100}, "isotropic noise, 1 sigma per axis");
    set.add("drift", &track_model.drift_px, "px", {0, 100},
            "random walk per image and axis, 1 sigma");
    set.add("loss_rate", &track_model.loss_rate, "-", {0, 1},
            "probability of losing a feature, per image");
    set.add("longest", &track_model.longest, "images", {0, 1e6},
            "length after which a feature is lost; 0: none");
    set.add("mistrack_rate", &track_model.mistrack_rate, "-", {0, 1},
            "probability of a jump, per observation");
    set.add("mistrack_size", &track_model.mistrack_px, "px", {0, 1e4},
            "size of a jump, 1 sigma per axis");

    paper.describe(set);
}

ScenarioOptions ScenarioOptions::from_file(const std::string& ini_file,
                                           const std::vector<std::string>& assignments) {
    ScenarioOptions options;
    OptionSet set;
    options.describe(set);
    load(ini_file, set, options, 0);
    for (const std::string& assignment : assignments) set.set(assignment);
    return options;
}

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
    if (!options.tracks) return;
    std::vector<Pose> T_W_C;
    for (const StateEstimate& state : truth_) T_W_C.push_back(state.T_W_B * rig_.T_B_C);
    Random random(static_cast<std::uint64_t>(options.seed), "tracks");
    tracks_ =
        simulate_tracks(scene_, *rig_.camera, image_times_, T_W_C, options.track_model, random);
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

cv::Mat Simulation::image(int image_idx) const {
    if (!renderer_) renderer_ = std::make_unique<Renderer>(scene_, rig_.camera, options_.rendering);
    const auto T_W_C_at = [this](double t) { return trajectory_->at(t).T_W_B * rig_.T_B_C; };
    const std::uint64_t noise_seed =
        Random::stream_seed(static_cast<std::uint64_t>(options_.seed), "image noise") +
        static_cast<std::uint64_t>(image_idx);
    return renderer_->image(seconds(image_times_[image_idx]), T_W_C_at, mixed(noise_seed));
}

}  // namespace vio
