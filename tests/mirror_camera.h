// The camera before an equiangular mirror of the paper's second configuration, and targets that it
// sees, for tests of the mirror's place.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "libvio/batch/batch.h"
#include "libvio/calibration/mirror_calibration.h"
#include "libvio/camera/description.h"
#include "libvio/simulation/random.h"

namespace vio::test {

inline CameraDescription mirror_description(const Pose& T_C_M = {}) {
    CameraDescription d;
    d.model = "equiangular_mirror";
    d.lens = {640, 480, 2162, 2162, 319.5, 239.5, {}};
    d.shape.apex_distance = 0.15;
    d.shape.gain = 15;
    d.shape.rim_radius = 0.0172;
    d.shape.blind_radius = 0.004;
    d.T_C_M = T_C_M;
    return d;
}

inline std::shared_ptr<const MirrorCamera> mirror_camera(const Pose& T_C_M = {}) {
    return std::static_pointer_cast<const MirrorCamera>(make_camera(mirror_description(T_C_M)));
}

/// Off by half a degree and a millimetre.
inline Pose misaligned_mirror(Random& random) {
    const double about_y = random.normal(), about_x = random.normal();
    return {so3::exp(0.008 * Eigen::Vector3d(about_x, about_y, 0)), 5e-4 * random.normal3()};
}

/// One image of targets.
struct MirrorShot {
    Pose T_C_M, T_G_C;
    FeatureFrame frame;
    std::map<FeatureId, Fiducial> targets;

    MirrorCalibration calibrate(const MirrorCalibrationOptions& options = {}) const {
        return calibrate_mirror(*mirror_camera(), {frame}, targets, options);
    }
};

/// Targets all around, evenly in the image, 0.5 to 2.5 m away.
inline MirrorShot mirror_shot(std::uint64_t seed, int count, double noise_px) {
    Random random(seed, "mirror calibration");
    MirrorShot shot;
    shot.T_C_M = misaligned_mirror(random);
    shot.T_G_C = {so3::exp(0.5 * random.normal3()), random.normal3()};
    const auto camera = mirror_camera(shot.T_C_M);
    while (static_cast<int>(shot.targets.size()) < count) {
        const double v = 480 * random.uniform(), u = 640 * random.uniform();
        const Eigen::Vector2d uv(u, v);
        const double distance = random.uniform(0.5, 2.5);
        const Eigen::Vector2d noise = noise_px * random.normal2();
        const auto ray = camera->ray(uv);
        if (!ray) continue;
        const auto id = static_cast<FeatureId>(shot.targets.size());
        shot.targets[id].p_W = shot.T_G_C * (ray->origin + distance * ray->direction);
        shot.frame.features.push_back({id, uv + noise});
    }
    return shot;
}

/// Errors in the five components of the mirror's place that can be seen.
struct MirrorErrors {
    double rotation = 0, position = 0;  ///< [rad], [m]
    double nees = 0;                    ///< chi-square with 5 degrees of freedom
};

inline MirrorErrors mirror_errors(const Pose& T_C_M, const MirrorCalibration& found) {
    const Vector6d error = T_C_M.boxminus(found.T_C_M);
    const std::vector<int> seen{0, 1, 3, 4, 5};
    const Eigen::VectorXd e = error(seen);
    return {error.head<2>().norm(), error.tail<3>().norm(),
            e.dot(found.covariance(seen, seen).ldlt().solve(e))};
}

}  // namespace vio::test
