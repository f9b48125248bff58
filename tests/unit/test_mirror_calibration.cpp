#include <gtest/gtest.h>

#include "libvio/base/errors.h"
#include "tests/mirror_camera.h"

namespace vio {
namespace {

using test::mirror_camera;
using test::mirror_shot;
using test::MirrorShot;

TEST(MirrorCalibration, ExactTargetsGiveTheExactPlaceFromAnAlignedStart) {
    const MirrorShot s = mirror_shot(3, 40, 0);
    const auto c = s.calibrate();
    EXPECT_LT((s.T_C_M.R.col(2) - c.T_C_M.R.col(2)).norm(), 1e-7);
    EXPECT_LT((s.T_C_M.p - c.T_C_M.p).norm(), 1e-8);
    EXPECT_LT(s.T_G_C.boxminus(c.views.at(0).T_G_C).norm(), 1e-6);
    EXPECT_LT(c.rms_px, 1e-6);
}

// Sum of n runs' NEES is chi-square with 5 n degrees of freedom: bounds of 99.9 %.
TEST(MirrorCalibration, ErrorsAreAsLargeAsTheCovarianceSays) {
    for (const bool pose_known : {true, false}) {
        constexpr int kRuns = 40;
        double sum = 0;
        for (int seed = 0; seed < kRuns; ++seed) {
            const MirrorShot s = mirror_shot(static_cast<std::uint64_t>(seed), 100, 1);
            MirrorCalibrationOptions options;
            options.sigma_px = 1;
            if (pose_known) options.T_G_C = s.T_G_C;
            sum += test::mirror_errors(s.T_C_M, s.calibrate(options)).nees;
        }
        const double expected = 5 * kRuns, spread = 3.3 * std::sqrt(2 * expected);
        EXPECT_NEAR(sum, expected, spread) << pose_known;
    }
}

TEST(MirrorCalibration, NoiseIsFoundFromTheResiduals) {
    const MirrorShot s = mirror_shot(5, 300, 0.7);
    const auto c = s.calibrate();
    EXPECT_NEAR(c.sigma_px, 0.7, 4 * 0.7 / std::sqrt(2 * 600));
}

TEST(MirrorCalibration, MistakenTargetsAreDropped) {
    MirrorShot s = mirror_shot(5, 300, 0.5);
    for (int k = 0; k < 15; ++k) s.frame.features[20 * k].uv_px += Eigen::Vector2d(12, -9);
    const auto c = s.calibrate();
    EXPECT_EQ(c.outliers, 15);
    EXPECT_LT(test::mirror_errors(s.T_C_M, c).nees, 20.5);  // 99.9 %
}

TEST(MirrorCalibration, TooFewTargetsAreRefused) {
    EXPECT_THROW(mirror_shot(1, 5, 0).calibrate(), InputError);
}

// Targets on the floor, in one image or seen by several that the camera took elsewhere.
TEST(MirrorCalibration, PlanarTargetsDo) {
    Random random(4, "planar targets");
    const Pose T_C_M = test::misaligned_mirror(random);
    const auto camera = mirror_camera(T_C_M);
    std::map<FeatureId, Fiducial> floor;
    for (int i = -6; i <= 6; ++i)
        for (int j = -6; j <= 6; ++j)
            floor[static_cast<FeatureId>(floor.size())].p_W = {0.1 * i, 0.1 * j, 0};
    std::vector<FeatureFrame> frames;
    std::vector<Pose> T_G_C;
    for (int k = 0; k < 4; ++k) {
        T_G_C.push_back({so3::exp(0.4 * random.normal3()),
                         Eigen::Vector3d(0.2 * random.normal(), 0.2 * random.normal(), 0.5)});
        frames.push_back({k, {}});
        for (const auto& [id, target] : floor) {
            const auto uv = camera->project(T_G_C[k].inverse() * target.p_W);
            if (uv && camera->ray(*uv)) frames[k].features.push_back({id, *uv});
        }
        ASSERT_GT(frames[k].features.size(), 40U);
    }
    for (const auto& some : {frames, {frames[0]}}) {
        const auto c = calibrate_mirror(*mirror_camera(), some, floor);
        EXPECT_EQ(c.views.size(), some.size());
        EXPECT_LT(test::mirror_errors(T_C_M, c).rotation, 1e-6);
        EXPECT_LT(test::mirror_errors(T_C_M, c).position, 1e-7);
        EXPECT_LT(T_G_C[0].boxminus(c.views.at(0).T_G_C).norm(), 1e-5);
    }
}

}  // namespace
}  // namespace vio
