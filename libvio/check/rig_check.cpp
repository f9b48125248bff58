#include "libvio/check/rig_check.h"

#include <algorithm>
#include <cmath>

#include "libvio/base/angles.h"
#include "libvio/camera/perspective.h"

namespace vio {
namespace {

constexpr double kNarrowest = 15 * kDegree, kWidest = 150 * kDegree;
constexpr double kFarthest = 3;      // [m] between camera and IMU
constexpr double kCentreOff = 0.25;  // of the image's size
constexpr double kRoundTrip = 0.1;   // [px]

// Pixels of a grid whose ray leads back to them, and of those that have a ray.
struct RoundTrip {
    int rays = 0, back = 0;
};

RoundTrip round_trip(const Camera& camera) {
    constexpr int kGrid = 16;
    RoundTrip result;
    for (int i = 0; i <= kGrid; ++i)
        for (int j = 0; j <= kGrid; ++j) {
            const Eigen::Vector2d uv((camera.width() - 1) * i / double{kGrid},
                                     (camera.height() - 1) * j / double{kGrid});
            const auto ray = camera.ray(uv);
            if (!ray) continue;
            ++result.rays;
            const auto again = camera.project(ray->origin + 10 * ray->direction);
            result.back += again && (*again - uv).norm() < kRoundTrip;
        }
    return result;
}

Finding check_model(const Camera& camera) {
    const RoundTrip trip = round_trip(camera);
    Finding f{Grade::ok, "camera model",
              formatted("%s, %dx%d px, %.2f mrad a pixel; %d of %d rays lead back to their pixel",
                        camera.model_name().c_str(), camera.width(), camera.height(),
                        1e3 * camera.angular_resolution(), trip.back, trip.rays),
              "all", ""};
    if (trip.back == trip.rays && trip.rays > 0) return f;
    f.grade = trip.back < 0.9 * trip.rays || trip.rays == 0 ? Grade::error : Grade::warning;
    f.advice = "the distortion folds the image over; see the order and signs of its coefficients";
    return f;
}

Finding check_lens(const PerspectiveCamera& camera) {
    const PerspectiveParameters& p = camera.parameters();
    const double view = 2 * std::atan(0.5 * std::max(p.width / p.fx, p.height / p.fy));
    Finding f{Grade::ok, "field of view",
              formatted("%.0f deg, centre at %.2f, %.2f of the image", view / kDegree,
                        p.cx / p.width, p.cy / p.height),
              formatted("%.0f to %.0f deg, centre near the middle", kNarrowest / kDegree,
                        kWidest / kDegree),
              ""};
    const double off = std::max(std::abs(p.cx / p.width - 0.5), std::abs(p.cy / p.height - 0.5));
    if (view < kNarrowest || view > kWidest || off > kCentreOff) {
        f.grade = off > 0.5 || view > kWidest ? Grade::error : Grade::warning;
        f.advice = "intrinsics of another image size or lens, or in other units than pixels";
    }
    return f;
}

Finding check_places(const Rig& rig) {
    const Pose T_I_C = rig.T_I_C();
    Finding f{Grade::ok, "camera-IMU place", formatted("%.3f m apart", T_I_C.p.norm()),
              formatted("at most %g m", kFarthest), ""};
    if (T_I_C.p.norm() > kFarthest) {
        f.grade = Grade::warning;
        f.advice = "are the extrinsics in metres?";
    }
    if (T_I_C.R.isIdentity(1e-9) && T_I_C.p.isZero(1e-9)) {
        f.grade = Grade::warning;
        f.measured = "same place, same axes";
        f.limit = "";
        f.advice = "extrinsics look unset: give cameraPose and sensorPose, or --calibration";
    }
    return f;
}

Finding check_noise(const Rig& rig) {
    const ImuNoise& n = rig.imu_noise;
    const ImuNoise unset;
    Finding f{Grade::ok, "IMU noise",
              formatted("gyro %.2g rad/s/sqrt(Hz), accelerometer %.2g m/s^2/sqrt(Hz)",
                        n.gyro_noise_density, n.accel_noise_density),
              "", ""};
    if (n.gyro_noise_density == unset.gyro_noise_density &&
        n.accel_noise_density == unset.accel_noise_density)
        f.advice = "the built-in values of a consumer sensor";
    return f;
}

}  // namespace

std::vector<Finding> check_rig(const Rig& rig, bool with_imu) {
    std::vector<Finding> findings;
    if (!rig.camera) {
        findings.push_back({Grade::error, "camera model", "not calibrated", "",
                            "give --calibration FILE, or intrinsics in cameraParams"});
    } else {
        findings.push_back(check_model(*rig.camera));
        if (const auto* lens = dynamic_cast<const PerspectiveCamera*>(rig.camera.get()))
            findings.push_back(check_lens(*lens));
    }
    if (with_imu) {
        if (rig.camera) findings.push_back(check_places(rig));
        findings.push_back(check_noise(rig));
    }
    return findings;
}

}  // namespace vio
