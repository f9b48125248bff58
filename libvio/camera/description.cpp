#include "libvio/camera/description.h"

#include <algorithm>

#include "libvio/base/errors.h"
#include "libvio/camera/fisheye.h"
#include "libvio/camera/mirror.h"
#include "libvio/camera/unified.h"

namespace vio {
namespace {

using Kind = MirrorShapeParameters::Kind;

CameraPtr make_fisheye(const CameraDescription& d) {
    const PerspectiveParameters& l = d.lens;
    for (std::size_t i = 4; i < l.distortion.size(); ++i)
        if (l.distortion[i] != 0)
            throw InputError(
                "camera calibration: the distortion of a fisheye camera has four coefficients");
    FisheyeParameters p{l.width, l.height, l.fx, l.fy, l.cx, l.cy, {}, d.max_angle};
    std::copy_n(l.distortion.begin(), 4, p.k.begin());
    return std::make_shared<FisheyeCamera>(p);
}

CameraPtr make_mirror(const CameraDescription& d) {
    MirrorParameters p{d.lens, d.shape, d.T_C_M};
    p.shape.kind = d.model == "equiangular_mirror"  ? Kind::kEquiangular
                   : d.model == "hyperbolic_mirror" ? Kind::kHyperbolic
                                                    : Kind::kParabolic;
    return std::make_shared<MirrorCamera>(p);
}

}  // namespace

const std::vector<std::string>& camera_models() {
    static const std::vector<std::string> models{"perspective",       "fisheye",
                                                 "unified",           "equiangular_mirror",
                                                 "hyperbolic_mirror", "parabolic_mirror"};
    return models;
}

bool is_mirror_model(const std::string& model) {
    return model.ends_with("_mirror");
}

CameraPtr make_camera(const CameraDescription& d) {
    if (d.model == "perspective") return std::make_shared<PerspectiveCamera>(d.lens);
    if (d.model == "fisheye") return make_fisheye(d);
    if (d.model == "unified")
        return std::make_shared<UnifiedCamera>(
            UnifiedParameters{d.lens, d.xi, d.mirror, d.min_angle, d.max_angle});
    const auto& models = camera_models();
    if (std::find(models.begin(), models.end(), d.model) == models.end()) {
        std::string known;
        for (const std::string& model : models) known += (known.empty() ? "" : ", ") + model;
        throw InputError("camera calibration: '" + d.model + "' is not a camera model; " + known +
                         " are");
    }
    return make_mirror(d);
}

CameraDescription describe(const Camera& camera) {
    CameraDescription d;
    d.model = camera.model_name();
    if (const auto* perspective = dynamic_cast<const PerspectiveCamera*>(&camera)) {
        d.lens = perspective->parameters();
    } else if (const auto* fisheye = dynamic_cast<const FisheyeCamera*>(&camera)) {
        const FisheyeParameters& p = fisheye->parameters();
        d.lens = {p.width, p.height, p.fx, p.fy, p.cx, p.cy, {}};
        std::copy(p.k.begin(), p.k.end(), d.lens.distortion.begin());
        d.max_angle = p.max_angle;
    } else if (const auto* unified = dynamic_cast<const UnifiedCamera*>(&camera)) {
        const UnifiedParameters& p = unified->parameters();
        d.lens = p.lens;
        d.xi = p.xi;
        d.mirror = p.mirror;
        d.min_angle = p.min_angle;
        d.max_angle = p.max_angle;
    } else if (const auto* mirror = dynamic_cast<const MirrorCamera*>(&camera)) {
        const MirrorParameters& p = mirror->parameters();
        d.lens = p.lens;
        d.shape = p.shape;
        d.T_C_M = p.T_C_M;
    } else {
        throw InputError("camera of the model " + camera.model_name() + ": has no description");
    }
    return d;
}

}  // namespace vio
