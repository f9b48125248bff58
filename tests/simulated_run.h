// A hand-held camera and IMU in a room of points: readings and tracks with known truth, made
// without any of the library's estimators.
#pragma once

#include <cmath>
#include <functional>
#include <map>
#include <random>
#include <vector>

#include "libvio/base/angles.h"
#include "libvio/base/estimate.h"
#include "libvio/batch/batch.h"
#include "libvio/camera/perspective.h"
#include "libvio/camera/rig.h"
#include "tests/draws.h"

namespace vio::test {

/// Smooth motion with about 1 rad/s and 2 m/s^2, position and attitude of I in W.
struct SimulatedPath {
    static Eigen::Vector3d position(double t) {
        return {1.2 * std::sin(0.9 * t) + 0.3 * std::sin(2.1 * t),
                1.0 * std::sin(0.7 * t + 0.5) + 0.25 * std::cos(1.9 * t),
                0.5 * std::sin(1.1 * t + 1.0) + 0.15 * std::sin(2.7 * t)};
    }
    static Eigen::Matrix3d rotation(double t) {
        const double yaw = 0.35 * t + 0.5 * std::sin(0.8 * t);
        const double pitch = 0.35 * std::sin(1.3 * t), roll = 0.3 * std::sin(1.7 * t + 0.4);
        return (Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
                Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
                Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()))
            .toRotationMatrix();
    }
    // Of this path, or of another one.
    using Positions = std::function<Eigen::Vector3d(double)>;
    using Rotations = std::function<Eigen::Matrix3d(double)>;
    static Eigen::Vector3d velocity(double t, const Positions& path = position) {
        constexpr double h = 1e-4;
        return (path(t + h) - path(t - h)) / (2 * h);
    }
    static Eigen::Vector3d acceleration(double t, const Positions& path = position) {
        constexpr double h = 1e-3;
        return (path(t + h) - 2 * path(t) + path(t - h)) / (h * h);
    }
    static Eigen::Vector3d angular_velocity(double t, const Rotations& path = rotation) {
        constexpr double h = 1e-4;
        return so3::log(path(t - h).transpose() * path(t + h)) / (2 * h);
    }
};

struct SimulatedRunOptions {
    unsigned seed = 1;
    double seconds = 20;
    double imu_hz = 200, image_hz = 20;
    int features = 60;        ///< tracked at once, at most
    int longest_track = 120;  ///< images
    double sigma_px = 1;
    double outliers = 0;  ///< share of observations that are anywhere in the image
    ImuNoise noise{1.7e-4, 2e-3, 2e-5, 3e-3, 0};
    double time_offset = 0;                                       ///< [s]
    SimulatedPath::Positions position = SimulatedPath::position;  ///< p_W_I at t
    SimulatedPath::Rotations rotation = SimulatedPath::rotation;  ///< R_W_I at t
};

struct SimulatedRun {
    Rig rig;
    std::vector<ImuReading> readings;
    std::vector<FeatureFrame> frames;
    std::vector<StateEstimate> truth;  ///< at each frame, without covariance
    std::vector<Eigen::Vector3d> points;
    std::vector<std::size_t> point_of_feature;
};

inline SimulatedRun simulate_run(const SimulatedRunOptions& options) {
    SimulatedRun run;
    std::mt19937 random(options.seed);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> uniform(0, 1);
    const auto noise3 = [&] { return normal_vector<3>(normal, random); };

    PerspectiveParameters camera;
    camera.width = 752;
    camera.height = 480;
    camera.fx = camera.fy = 458;
    camera.cx = 376;
    camera.cy = 240;
    run.rig.camera = std::make_shared<PerspectiveCamera>(camera);
    // The camera looks along the body's x axis; the IMU sits off the body's origin, turned.
    Eigen::Matrix3d R_B_C;
    R_B_C << 0, 0, 1, -1, 0, 0, 0, -1, 0;
    run.rig.T_B_C = {R_B_C, {0.05, 0.02, 0.01}};
    run.rig.T_B_I = {so3::exp({0.2, -0.1, 0.3}), {-0.03, 0.04, -0.02}};
    run.rig.imu_noise = options.noise;
    run.rig.time_offset = options.time_offset;
    const Pose T_I_B = run.rig.T_B_I.inverse();

    constexpr TimeNs kStart = 1'400'000'000'000'000'000;
    const Eigen::Vector3d g_W(0, 0, -9.81);
    Eigen::Vector3d gyro_bias = 0.01 * noise3(), accel_bias = 0.1 * noise3();
    const double dt = 1 / options.imu_hz;
    const int readings = static_cast<int>(options.seconds * options.imu_hz) + 2;
    std::vector<Eigen::Vector3d> gyro_biases, accel_biases;
    for (int i = 0; i < readings; ++i) {
        const double t = i * dt;
        const Eigen::Matrix3d R_I_W = options.rotation(t).transpose();
        ImuReading reading;
        reading.t = kStart + from_seconds(t);
        reading.gyro = SimulatedPath::angular_velocity(t, options.rotation) + gyro_bias +
                       options.noise.gyro_noise_density / std::sqrt(dt) * noise3();
        reading.accel = R_I_W * (SimulatedPath::acceleration(t, options.position) - g_W) +
                        accel_bias + options.noise.accel_noise_density / std::sqrt(dt) * noise3();
        run.readings.push_back(reading);
        gyro_biases.push_back(gyro_bias);
        accel_biases.push_back(accel_bias);
        gyro_bias += options.noise.gyro_bias_random_walk * std::sqrt(dt) * noise3();
        accel_bias += options.noise.accel_bias_random_walk * std::sqrt(dt) * noise3();
    }

    // Points on the walls of a box around the path.
    constexpr int kPoints = 1500;
    for (int i = 0; i < kPoints; ++i) {
        Eigen::Vector3d x(8 * uniform(random) - 4, 8 * uniform(random) - 4,
                          4 * uniform(random) - 2);
        const int wall = static_cast<int>(4 * uniform(random));
        x(wall / 2) = (wall % 2 ? 1 : -1) * (3.2 + 0.8 * uniform(random));
        run.points.push_back(x);
    }

    struct Live {
        FeatureId id;
        int images;
    };
    std::map<std::size_t, Live> live;  // by point
    FeatureId next_id = 0;
    const int images = static_cast<int>((options.seconds - options.time_offset) * options.image_hz);
    for (int i = 0; i < images; ++i) {
        const double t_camera = (i + 0.37) / options.image_hz;  // not at a reading's time
        const double t = t_camera + options.time_offset;
        const int nearest = std::min(readings - 1, static_cast<int>(t * options.imu_hz));
        const Pose T_W_I{options.rotation(t), options.position(t)};
        StateEstimate truth;
        truth.t = kStart + from_seconds(t_camera);
        truth.T_W_B = T_W_I * T_I_B;
        truth.v_W = SimulatedPath::velocity(t, options.position) +
                    T_W_I.R * SimulatedPath::angular_velocity(t, options.rotation).cross(T_I_B.p);
        truth.gyro_bias = gyro_biases[nearest];
        truth.accel_bias = accel_biases[nearest];
        run.truth.push_back(truth);

        const Pose T_C_W = (truth.T_W_B * run.rig.T_B_C).inverse();
        const auto seen = [&](std::size_t point) -> std::optional<Eigen::Vector2d> {
            const auto uv = run.rig.camera->project(T_C_W * run.points[point]);
            if (!uv || !run.rig.camera->inside_image(*uv, 2)) return std::nullopt;
            return uv;
        };
        for (auto it = live.begin(); it != live.end();) {
            const bool ends = ++it->second.images > options.longest_track || !seen(it->first);
            it = ends ? live.erase(it) : std::next(it);
        }
        const std::size_t first = static_cast<std::size_t>(kPoints * uniform(random));
        for (std::size_t k = 0;
             k < kPoints && live.size() < static_cast<std::size_t>(options.features); ++k) {
            const std::size_t point = (first + k) % kPoints;
            if (live.count(point) || !seen(point)) continue;
            live[point] = {next_id++, 0};
            run.point_of_feature.push_back(point);
        }
        FeatureFrame frame;
        frame.t = truth.t;
        for (const auto& [point, feature] : live) {
            FeatureObservation observation;
            observation.feature_id = feature.id;
            observation.uv_px = *seen(point) + options.sigma_px * normal_vector<2>(normal, random);
            if (uniform(random) < options.outliers)
                observation.uv_px = {camera.width * uniform(random),
                                     camera.height * uniform(random)};
            frame.features.push_back(observation);
        }
        run.frames.push_back(std::move(frame));
    }
    return run;
}

/// Five seconds along the same path while turning about a random axis by `span_deg`, at 30 Hz.
inline SimulatedRunOptions turning_run(int span_deg, unsigned seed) {
    std::mt19937 engine(1000 * static_cast<unsigned>(span_deg) + seed);
    std::normal_distribution<double> normal;
    const Eigen::Vector3d axis = normal_vector<3>(normal, engine).normalized();
    SimulatedRunOptions options;
    options.seed = seed;
    options.seconds = 5;
    options.image_hz = 30;
    options.features = 40;
    options.longest_track = 60;
    const double rate = span_deg * kDegree / options.seconds;
    options.rotation = [=](double t) -> Eigen::Matrix3d { return so3::exp(rate * t * axis); };
    return options;
}

/// Start at a frame with errors drawn from the covariance that it states; points in the frame
/// included. Position and yaw are exact, as where a world frame begins.
inline BatchTail sampled_start(const SimulatedRun& run, std::size_t frame, unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    BatchTail tail;
    tail.state = run.truth[frame];
    tail.g_W = {0, 0, -9.81};
    const auto& features = run.frames[frame].features;
    const Eigen::Index size = 15 + 3 * static_cast<Eigen::Index>(features.size());
    Eigen::VectorXd sigma = Eigen::VectorXd::Constant(size, 0.1);
    sigma.head<15>() << 5e-3, 5e-3, 5e-3, 1e-3, 1e-3, 1e-3, 0.02, 0.02, 0.02, 1e-3, 1e-3, 1e-3,
        0.05, 0.05, 0.05;
    tail.covariance = sigma.cwiseAbs2().asDiagonal();
    // Tilt in W, hardly any yaw.
    const Eigen::Matrix3d Rt = tail.state.T_W_B.R.transpose();
    tail.covariance.topLeftCorner<3, 3>() =
        Rt * Eigen::Vector3d(25e-6, 25e-6, 1e-8).asDiagonal() * Rt.transpose();
    Eigen::VectorXd d(size);
    for (Eigen::Index i = 0; i < size; ++i) d(i) = normal(random);
    d = (tail.covariance.llt().matrixL() * d).eval();
    tail.state.T_W_B = tail.state.T_W_B.boxplus(d.head<6>());
    tail.state.v_W += d.segment<3>(kVelocity);
    tail.state.gyro_bias += d.segment<3>(kGyroBias);
    tail.state.accel_bias += d.segment<3>(kAccelBias);
    tail.state.covariance = tail.covariance.topLeftCorner<15, 15>();
    for (std::size_t i = 0; i < features.size(); ++i) {
        LandmarkEstimate landmark;
        landmark.id = features[i].feature_id;
        landmark.p_W = run.points[run.point_of_feature[landmark.id]] +
                       d.segment<3>(15 + 3 * static_cast<Eigen::Index>(i));
        landmark.covariance = tail.covariance.block<3, 3>(15 + 3 * i, 15 + 3 * i);
        landmark.observations = 1;
        tail.landmarks.push_back(landmark);
    }
    return tail;
}

}  // namespace vio::test
