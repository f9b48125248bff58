#include "libvio/simulation/scenario_camera.h"

#include <algorithm>
#include <array>
#include <numbers>
#include <sstream>

#include "libvio/camera/description.h"

namespace vio {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

// From x y z [m] yaw pitch roll [deg].
Pose pose_from(const std::string& text) {
    std::istringstream in(text);
    std::array<double, 6> v{};
    for (double& value : v) in >> value;
    std::string more;
    if (!in || in >> more)
        throw InputError("scenario [camera] mirror_pose: expected six numbers in '" + text + "'");
    using Eigen::AngleAxisd, Eigen::Vector3d;
    return {(AngleAxisd(v[3] * kDegree, Vector3d::UnitZ()) *
             AngleAxisd(v[4] * kDegree, Vector3d::UnitY()) *
             AngleAxisd(v[5] * kDegree, Vector3d::UnitX()))
                .toRotationMatrix(),
            {v[0], v[1], v[2]}};
}

}  // namespace

void ScenarioCamera::describe(OptionSet& set) {
    set.add("model", &model, camera_models(),
            "projection; the keys of each model: share/formats.md");
    set.add("max_angle", &max_angle_deg, "deg", {0, 180},
            "fisheye, unified: from the middle's ray to the outermost");
    set.add("min_angle", &min_angle_deg, "deg", {0, 180}, "unified: blind spot, likewise");
    set.add("xi", &xi, "-", {0, 100}, "unified: centre of projection from the sphere's centre");
    set.add("mirror", &mirror, "unified: the camera looks into a mirror");
    set.add("apex_distance", &apex_distance, "m", {0, 10}, "mirrors: from the camera to the apex");
    set.add("gain", &gain, "-", {0, 1000}, "equiangular_mirror: angle of the ray over image angle");
    set.add("eccentricity", &eccentricity, "-", {0, 1000}, "hyperbolic_mirror");
    set.add("semi_latus_rectum", &semi_latus_rectum, "m", {0, 10}, "parabolic_mirror");
    set.add("rim_radius", &rim_radius, "m", {0, 10}, "mirrors: outer radius");
    set.add("blind_radius", &blind_radius, "m", {0, 10},
            "mirrors: of the middle, in which the camera sees itself");
    set.add("mirror_pose", &mirror_pose,
            "x y z yaw pitch roll [m, deg] of the mirror in the camera frame (T_C_M); zeros: "
            "aligned");
}

CameraPtr ScenarioCamera::make(int width, int height, const std::vector<double>& intrinsics,
                               const std::vector<double>& distortion) const {
    if (intrinsics.size() != 4)
        throw InputError("scenario [camera] intrinsics: expected four numbers, fx fy cx cy");
    CameraDescription d;
    d.model = model;
    d.lens = {width, height, intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3], {}};
    if (distortion.size() > d.lens.distortion.size())
        throw InputError("scenario [camera] distortion: more than eight coefficients");
    std::copy(distortion.begin(), distortion.end(), d.lens.distortion.begin());
    d.min_angle = min_angle_deg * kDegree;
    d.max_angle = max_angle_deg * kDegree;
    d.xi = xi;
    d.mirror = mirror;
    d.shape.gain = gain;
    d.shape.apex_distance = apex_distance;
    d.shape.eccentricity = eccentricity;
    d.shape.semi_latus_rectum = semi_latus_rectum;
    d.shape.rim_radius = rim_radius;
    d.shape.blind_radius = blind_radius;
    d.T_C_M = pose_from(mirror_pose);
    try {
        return make_camera(d);
    } catch (const InputError& reason) {
        throw InputError(std::string("scenario [camera]: ") + reason.what());
    }
}

}  // namespace vio
