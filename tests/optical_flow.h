// Rendered images against an independent tracker: OpenCV's Lucas-Kanade from image to image.
#pragma once

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <string>
#include <vector>

#include "libvio/base/median.h"
#include "libvio/simulation/scenario.h"

namespace vio::test {

/// Where a pixel of the first image is seen in the second by the scene's geometry.
inline std::optional<Eigen::Vector2d> true_flow(const Scene& scene, const Camera& camera,
                                                const Pose& T_W_C1, const Pose& T_W_C2,
                                                const Eigen::Vector2d& uv_px) {
    const auto ray = camera.ray(uv_px);
    if (!ray) return std::nullopt;
    const Eigen::Vector3d origin = T_W_C1 * ray->origin, direction = T_W_C1.R * ray->direction;
    const auto hit = scene.cast(origin, direction);
    if (!hit) return std::nullopt;
    const Eigen::Vector3d p_W = origin + hit->distance * direction;
    const auto uv2 = camera.project(T_W_C2.inverse() * p_W);
    if (!uv2 || !camera.inside_image(*uv2, 15)) return std::nullopt;
    return uv2;
}

/// Distances between what Lucas-Kanade finds from image `first` to the next and the true places
/// [px].
inline std::vector<double> flow_errors(const Simulation& simulation, int first, int window_px) {
    const cv::Mat a = simulation.image(first), b = simulation.image(first + 1);
    const auto T_W_C = [&](int i) { return simulation.truth()[i].T_W_B * simulation.rig().T_B_C; };
    std::vector<cv::Point2f> corners, found;
    cv::goodFeaturesToTrack(a, corners, 200, 0.02, 8);
    std::vector<std::uint8_t> status;
    std::vector<float> residual;
    cv::calcOpticalFlowPyrLK(a, b, corners, found, status, residual, {window_px, window_px}, 3,
                             {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 50, 1e-3});
    std::vector<double> errors;
    for (size_t i = 0; i < corners.size(); ++i) {
        const auto truth = true_flow(simulation.scene(), *simulation.rig().camera, T_W_C(first),
                                     T_W_C(first + 1), {corners[i].x, corners[i].y});
        if (!truth || !status[i]) continue;
        errors.push_back((Eigen::Vector2d(found[i].x, found[i].y) - *truth).norm());
    }
    return errors;
}

/// A camera that is carried through a room at 0.5 m/s, turning by 25 deg/s; 30 Hz, with blur and
/// noise.
struct FlowCase {
    std::string name;
    ScenarioOptions options;
};

inline std::vector<FlowCase> flow_cases() {
    ScenarioOptions base;
    base.motion.waypoints =
        "0 -0.5 -0.2 1.2 0 0 0, 1 -0.1 0.1 1.3 20 5 -5, 2 0.4 0.3 1.2 50 -5 5, 3 0.9 0.1 1.1 75 0 "
        "0";
    base.motion.at_rest = false;
    base.first_image_s = 0.5;
    base.image_count = 60;
    base.scene = "room";
    base.rendering.exposure = 0.004;
    base.rendering.read_noise = 1.5;
    base.rendering.shot_noise = 2;
    base.rendering.vignetting = 0.15;
    const auto make = [&](const std::string& name, int width, int height,
                          const std::string& intrinsics, const std::string& distortion) {
        FlowCase result{name, base};
        result.options.camera.model = name;
        result.options.image_width = width;
        result.options.image_height = height;
        result.options.intrinsics = intrinsics;
        result.options.distortion = distortion;
        result.options.camera_pose = "0 0 0 -90 0 -90";  // looks ahead
        return result;
    };
    std::vector<FlowCase> cases;
    cases.push_back(make("perspective", 752, 480, "458.654 457.296 367.215 248.375",
                         "-0.28340811 0.07395907 0.00019359 1.76187114e-05"));
    cases.push_back(cases.back());  // one field of an interlaced image
    cases.back().name = "perspective, single field";
    cases.back().options.image_height = 240;
    cases.back().options.intrinsics = "458.654 228.648 367.215 123.938";
    cases.back().options.rendering.row_fill = 0.5;
    cases.push_back(make("fisheye", 512, 512, "190.978 190.973 254.931 256.897",
                         "0.00348239 0.00071503 -0.00205323 0.000202937"));
    cases.back().options.camera.max_angle_deg = 95;
    cases.push_back(make("unified", 752, 480, "360 361.8 375 240", "-0.05 0.01 1e-3 -5e-4"));
    cases.back().options.camera.xi = 0.8;
    cases.back().options.camera.max_angle_deg = 100;

    const auto mirror = [&](const std::string& name, const std::string& focal, double apex,
                            double rim, double blind) -> ScenarioCamera& {
        cases.push_back(make(name, 640, 480, focal + " " + focal + " 319.5 239.5", ""));
        cases.back().options.camera_pose = "0 0 0 0 0 0";  // looks up
        ScenarioCamera& camera = cases.back().options.camera;
        camera.apex_distance = apex;
        camera.rim_radius = rim;
        camera.blind_radius = blind;
        camera.mirror_pose = "0.001 -0.0015 0.003 5 1 -1";
        return camera;
    };
    mirror("equiangular_mirror", "2162", 0.15, 0.0166, 0.003).gain = 17;
    mirror("hyperbolic_mirror", "1100", 0.15, 0.04, 0.003).eccentricity = 1.25;
    mirror("parabolic_mirror", "10000", 0.1, 0.023, 0.002).semi_latus_rectum = 0.02;
    return cases;
}

}  // namespace vio::test
