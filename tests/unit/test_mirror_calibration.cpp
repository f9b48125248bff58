#include <gtest/gtest.h>

#include "libvio/base/errors.h"
#include "libvio/camera/description.h"
#include "libvio/camera/mirror_calibration.h"
#include "libvio/simulation/random.h"

namespace vio {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

std::shared_ptr<const MirrorCamera> camera_with(const Pose& T_C_M) {
    CameraDescription d;
    d.model = "equiangular_mirror";
    d.lens = {640, 480, 2162, 2162, 319.5, 239.5, {}};
    d.shape.apex_distance = 0.15;
    d.shape.gain = 15;
    d.shape.rim_radius = 0.0172;
    d.shape.blind_radius = 0.004;
    d.T_C_M = T_C_M;
    return std::static_pointer_cast<const MirrorCamera>(make_camera(d));
}

struct Shot {
    Pose T_C_M, T_G_C;
    std::vector<CalibrationTarget> targets;
};

// Targets all around, 0.5 to 2.5 m away; mirror off by half a degree and a millimetre.
Shot make_shot(std::uint64_t seed, int count, double noise_px) {
    Random random(seed, "mirror calibration");
    Shot s;
    const Vector3d turn(random.normal(), random.normal(), 0);
    s.T_C_M = {so3::exp(0.008 * turn), 5e-4 * random.normal3()};
    s.T_G_C = {so3::exp(0.5 * random.normal3()), random.normal3()};
    const auto camera = camera_with(s.T_C_M);
    while (static_cast<int>(s.targets.size()) < count) {
        const Vector2d uv(640 * random.uniform(), 480 * random.uniform());
        const auto ray = camera->ray(uv);
        const double distance = 0.5 + 2 * random.uniform();
        const Vector2d noise = noise_px * random.normal2();
        if (!ray) continue;
        s.targets.push_back({s.T_G_C * (ray->origin + distance * ray->direction), uv + noise});
    }
    return s;
}

// Error in the five components that can be seen, and their covariance.
double nees(const Shot& s, const MirrorCalibration& c) {
    const Vector6d error = s.T_C_M.boxminus(c.T_C_M);
    const std::vector<int> seen{0, 1, 3, 4, 5};
    const Eigen::MatrixXd C = c.covariance(seen, seen);
    const Eigen::VectorXd e = error(seen);
    return e.dot(C.ldlt().solve(e));
}

TEST(MirrorCalibration, ExactTargetsGiveTheExactPlaceFromAnAlignedStart) {
    const Shot s = make_shot(3, 40, 0);
    const auto c = calibrate_mirror(*camera_with({}), s.targets);
    EXPECT_LT((s.T_C_M.R.col(2) - c.T_C_M.R.col(2)).norm(), 1e-7);
    EXPECT_LT((s.T_C_M.p - c.T_C_M.p).norm(), 1e-8);
    EXPECT_LT(s.T_G_C.boxminus(c.T_G_C).norm(), 1e-6);
    EXPECT_LT(c.rms_px, 1e-6);
}

// Sum of n runs' NEES is chi-square with 5 n degrees of freedom: bounds of 99.9 %.
TEST(MirrorCalibration, ErrorsAreAsLargeAsTheCovarianceSays) {
    for (const bool pose_known : {true, false}) {
        constexpr int kRuns = 40;
        double sum = 0;
        for (int seed = 0; seed < kRuns; ++seed) {
            const Shot s = make_shot(static_cast<std::uint64_t>(seed), 100, 1);
            MirrorCalibrationOptions options;
            options.sigma_px = 1;
            if (pose_known) options.T_G_C = s.T_G_C;
            sum += nees(s, calibrate_mirror(*camera_with({}), s.targets, options));
        }
        const double expected = 5 * kRuns, spread = 3.3 * std::sqrt(2 * expected);
        EXPECT_NEAR(sum, expected, spread) << pose_known;
    }
}

TEST(MirrorCalibration, NoiseIsFoundFromTheResiduals) {
    const Shot s = make_shot(5, 300, 0.7);
    const auto c = calibrate_mirror(*camera_with({}), s.targets);
    EXPECT_NEAR(c.sigma_px, 0.7, 4 * 0.7 / std::sqrt(2 * 600));
}

TEST(MirrorCalibration, TooFewOrPlanarTargetsAreRefused) {
    Shot s = make_shot(1, 5, 0);
    EXPECT_THROW(calibrate_mirror(*camera_with({}), s.targets), InputError);
    s = make_shot(1, 60, 0);
    std::vector<CalibrationTarget> planar;
    const auto camera = camera_with({});
    for (const CalibrationTarget& target : s.targets) {
        const auto ray = camera->ray(target.uv_px);
        if (!ray || ray->direction.z() > -0.1) continue;  // onto the floor
        const double distance = (-1 - ray->origin.z()) / ray->direction.z();
        planar.push_back({ray->origin + distance * ray->direction, target.uv_px});
    }
    try {
        calibrate_mirror(*camera, planar);
        FAIL();
    } catch (const InputError& error) {
        EXPECT_NE(std::string(error.what()).find("plane"), std::string::npos);
    }
    MirrorCalibrationOptions options;
    options.T_G_C = Pose{};
    EXPECT_LT(calibrate_mirror(*camera, planar, options).rms_px, 1e-6);
}

}  // namespace
}  // namespace vio
