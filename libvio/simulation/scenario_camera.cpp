#include "libvio/simulation/scenario_camera.h"

#include <algorithm>
#include <array>
#include <numbers>
#include <sstream>

#include "libvio/camera/fisheye.h"
#include "libvio/camera/mirror.h"
#include "libvio/camera/unified.h"

namespace vio {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

template <std::size_t N>
std::array<double, N> coefficients(const std::vector<double>& given) {
    if (given.size() > N)
        throw InputError("scenario [camera] distortion: " + std::to_string(given.size()) +
                         " coefficients, the model has " + std::to_string(N));
    std::array<double, N> all{};
    std::copy(given.begin(), given.end(), all.begin());
    return all;
}

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

MirrorShapeParameters::Kind mirror_kind(const std::string& model) {
    using Kind = MirrorShapeParameters::Kind;
    if (model == "hyperbolic_mirror") return Kind::kHyperbolic;
    return model == "parabolic_mirror" ? Kind::kParabolic : Kind::kEquiangular;
}

}  // namespace

void ScenarioCamera::describe(OptionSet& set) {
    set.add("model", &model,
            {"perspective", "fisheye", "unified", "equiangular_mirror", "hyperbolic_mirror",
             "parabolic_mirror"},
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
    const double fx = intrinsics[0], fy = intrinsics[1], cx = intrinsics[2], cy = intrinsics[3];
    if (model == "fisheye")
        return std::make_shared<FisheyeCamera>(FisheyeParameters{
            width, height, fx, fy, cx, cy, coefficients<4>(distortion), max_angle_deg * kDegree});
    const PerspectiveParameters lens{width, height, fx, fy, cx, cy, coefficients<8>(distortion)};
    if (model == "perspective") return std::make_shared<PerspectiveCamera>(lens);
    if (model == "unified")
        return std::make_shared<UnifiedCamera>(
            UnifiedParameters{lens, xi, mirror, min_angle_deg * kDegree, max_angle_deg * kDegree});
    const MirrorShapeParameters shape{mirror_kind(model), apex_distance, gain,        eccentricity,
                                      semi_latus_rectum,  rim_radius,    blind_radius};
    return std::make_shared<MirrorCamera>(MirrorParameters{lens, shape, pose_from(mirror_pose)});
}

}  // namespace vio
