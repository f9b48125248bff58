#include "libvio/simulation/scenario_options.h"

#include <array>
#include <filesystem>

namespace vio {
namespace {

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

}  // namespace

void CalibrationErrors::describe(OptionSet& set) {
    set.section("calibration");
    set.add("intrinsics_sigma", &intrinsics_sigma,
            "errors of the stated [camera] intrinsics, 1 sigma each, in their units and order; "
            "none: exact");
    set.add("distortion_sigma", &distortion_sigma, "the same of [camera] distortion");
    set.add("camera_rotation_sigma", &camera_rotation_deg, "deg", {0, 90},
            "error of the stated camera pose, 1 sigma per axis");
    set.add("camera_position_sigma", &camera_position, "m", {0, 10},
            "error of the stated camera pose, 1 sigma per axis");
    set.add("imu_rotation_sigma", &imu_rotation_deg, "deg", {0, 90},
            "error of the stated IMU pose, 1 sigma per axis");
    set.add("imu_position_sigma", &imu_position, "m", {0, 10},
            "error of the stated IMU pose, 1 sigma per axis");
    set.add("time_offset_error", &time_offset_error, "s", {-10, 10},
            "stated [imu] time_offset less the true one");
}

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
    track_model.describe(set);
    odometry.describe(set);
    gps.describe(set);
    messages.describe(set);
    calibration.describe(set);
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

}  // namespace vio
