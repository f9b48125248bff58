#include <gtest/gtest.h>

#include "libvio/base/errors.h"
#include "libvio/camera/perspective.h"
#include "tests/unit/numeric_jacobian.h"

namespace vio {
namespace {

PerspectiveParameters arm_camera() {  // Table 3 of the paper
    return {640, 240, 834.18, 419.88, 317.34, 105.30, {-0.290, 0.557, -0.00621, -0.00066}};
}
PerspectiveParameters mav_camera() {
    return {752,
            480,
            458.654,
            457.296,
            367.215,
            248.375,
            {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05}};
}
PerspectiveParameters rational_camera() {
    return {640, 480, 500, 505, 320, 240, {0.1, -0.05, 1e-3, -2e-3, 0.01, 0.12, -0.02, 0.003}};
}

class Perspective : public ::testing::TestWithParam<PerspectiveParameters> {};

TEST_P(Perspective, RayThenProjectReturnsThePixelUpToTheEdge) {
    const PerspectiveCamera camera(GetParam());
    for (int i = 0; i <= 40; ++i)
        for (int j = 0; j <= 40; ++j) {
            const Eigen::Vector2d uv(i * (camera.width() - 1) / 40.0,
                                     j * (camera.height() - 1) / 40.0);
            const auto ray = camera.ray(uv);
            ASSERT_TRUE(ray) << uv.transpose();
            const auto back = camera.project(3.7 * ray->direction);
            ASSERT_TRUE(back) << uv.transpose();
            EXPECT_LT((*back - uv).norm(), 1e-9);
        }
}

TEST_P(Perspective, JacobianMatchesCentralDifferences) {
    const PerspectiveCamera camera(GetParam());
    for (const Eigen::Vector3d& p : {Eigen::Vector3d(0.2, -0.1, 2), Eigen::Vector3d(-0.5, 0.1, 1.7),
                                     Eigen::Vector3d(0, 0, 1)}) {
        Matrix23d J;
        ASSERT_TRUE(camera.project(p, &J));
        const auto numeric = test::numeric_jacobian<2, 3>(
            [&](const Eigen::Vector3d& d) { return *camera.project(p + d); });
        EXPECT_LT((J - numeric).norm(), 1e-7 * numeric.norm());
    }
}

TEST_P(Perspective, RefusesPointsBehindAndBeyondTheField) {
    const PerspectiveCamera camera(GetParam());
    EXPECT_FALSE(camera.project({0, 0, -1}));
    EXPECT_FALSE(camera.project({0, 0, 0}));
    EXPECT_FALSE(camera.project({1000, 0, 1}));
}

INSTANTIATE_TEST_SUITE_P(Cameras, Perspective,
                         ::testing::Values(arm_camera(), mav_camera(), rational_camera()));

TEST(PerspectiveCamera, RefusesImpossibleIntrinsics) {
    EXPECT_THROW(PerspectiveCamera({0, 0, 1, 1, 0, 0, {}}), InputError);
    EXPECT_THROW(PerspectiveCamera({640, 480, -1, 1, 0, 0, {}}), InputError);
    EXPECT_THROW(PerspectiveCamera({640, 480, 500, 500, 320, 240, {-300, 0, 0, 0}}), InputError);
}

}  // namespace
}  // namespace vio
