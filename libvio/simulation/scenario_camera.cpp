#include "libvio/simulation/scenario_camera.h"

#include <algorithm>
#include <cmath>

#include "libvio/base/angles.h"
#include "libvio/camera/description.h"
#include "libvio/camera/mirror.h"
#include "libvio/simulation/scenario_text.h"

namespace vio {

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
    set.add("stated_mirror_pose", &stated_mirror_pose,
            "mirror_pose in the rawlog's calibration, if it is another");
    set.add("mirror_vibration", &mirror_vibration, "m", {0, 0.1},
            "vibration of the mirror across its axis at the path's RMS acceleration, 1 sigma per "
            "axis");
}

ScenarioCamera ScenarioCamera::stated() const {
    ScenarioCamera camera = *this;
    if (!stated_mirror_pose.empty()) camera.mirror_pose = stated_mirror_pose;
    return camera;
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
    d.T_C_M = pose_option(mirror_pose, "[camera] mirror_pose");
    try {
        return make_camera(d);
    } catch (const InputError& reason) {
        throw InputError(std::string("scenario [camera]: ") + reason.what());
    }
}

std::vector<CameraPtr> ScenarioCamera::vibrating(const CameraPtr& camera,
                                                 const std::vector<double>& accelerations,
                                                 Random& random) const {
    if (!(mirror_vibration > 0)) return {};
    const auto* mirror_camera = dynamic_cast<const MirrorCamera*>(camera.get());
    if (!mirror_camera)
        throw InputError("scenario [camera] mirror_vibration: a camera of model " + model +
                         " has no mirror of its own; take a *_mirror model or leave it out");
    double sum2 = 0;
    for (const double a : accelerations) sum2 += a * a;
    const double usual = std::sqrt(sum2 / static_cast<double>(accelerations.size()));
    std::vector<CameraPtr> cameras;
    for (const double a : accelerations) {
        MirrorParameters p = mirror_camera->parameters();
        const double sigma = usual > 0 ? mirror_vibration * a / usual : 0;
        p.T_C_M.p.head<2>() += sigma * random.normal2();
        cameras.push_back(std::make_shared<MirrorCamera>(p));
    }
    return cameras;
}

void apply_vibration(const Camera& steady, const std::vector<CameraPtr>& vibrating,
                     const std::vector<Pose>& T_W_C, SimulatedTracks& tracks) {
    for (std::size_t i = 0; i < tracks.frames.size(); ++i)
        for (FeatureObservation& feature : tracks.frames[i].features) {
            const Eigen::Vector3d p_C = T_W_C[i].inverse() * tracks.points_W.at(feature.feature_id);
            const auto at_rest = steady.project(p_C), now = vibrating[i]->project(p_C);
            if (at_rest && now) feature.uv_px += *now - *at_rest;
        }
}

}  // namespace vio
