// Properties that every camera model must have, and those of the mirrors.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "libvio/base/angles.h"
#include "libvio/base/errors.h"
#include "libvio/camera/fisheye.h"
#include "libvio/camera/mirror.h"
#include "libvio/camera/unified.h"
#include "tests/unit/numeric_jacobian.h"

namespace vio {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

struct Named {
    std::string name;
    std::function<CameraPtr()> make;
};
void PrintTo(const Named& named, std::ostream* out) {
    *out << named.name;
}

// 16 mm lens on 7.4 um pixels before a mirror of 34 mm.
PerspectiveParameters mirror_lens() {
    return {640, 480, 2162, 2162, 319.5, 239.5, {}};
}
MirrorShapeParameters equiangular() {
    MirrorShapeParameters shape;
    shape.kind = MirrorShapeParameters::Kind::kEquiangular;
    shape.apex_distance = 0.15;
    shape.gain = 17;
    shape.rim_radius = 0.0166;
    shape.blind_radius = 0.003;
    return shape;
}
MirrorShapeParameters hyperbolic() {
    MirrorShapeParameters shape;
    shape.kind = MirrorShapeParameters::Kind::kHyperbolic;
    shape.apex_distance = 0.15;
    shape.eccentricity = 1.25;
    shape.rim_radius = 0.04;
    shape.blind_radius = 0.003;
    return shape;
}
MirrorShapeParameters parabolic() {
    MirrorShapeParameters shape;
    shape.kind = MirrorShapeParameters::Kind::kParabolic;
    shape.apex_distance = 0.1;
    shape.semi_latus_rectum = 0.02;
    shape.rim_radius = 0.023;
    shape.blind_radius = 0.002;
    return shape;
}
Pose misaligned() {
    return {so3::exp({0.02, -0.015, 0.1}), {0.001, -0.0015, 0.003}};
}
CameraPtr mirror(const MirrorShapeParameters& shape, const Pose& T_C_M = {}) {
    PerspectiveParameters lens = mirror_lens();
    if (shape.kind == MirrorShapeParameters::Kind::kHyperbolic) lens.fx = lens.fy = 1100;
    if (shape.kind == MirrorShapeParameters::Kind::kParabolic) lens.fx = lens.fy = 10000;
    return std::make_shared<MirrorCamera>(MirrorParameters{lens, shape, T_C_M});
}
CameraPtr fisheye(double max_angle) {  // TUM-VI's first camera
    return std::make_shared<FisheyeCamera>(
        FisheyeParameters{512,
                          512,
                          190.978,
                          190.973,
                          254.931,
                          256.897,
                          {0.00348239, 0.00071503, -0.00205323, 0.000202937},
                          max_angle});
}
CameraPtr unified(double xi, bool is_mirror) {
    UnifiedParameters p;
    p.lens = {752, 480, 200 * (1 + xi), 201 * (1 + xi), 375, 240, {-0.05, 0.01, 1e-3, -5e-4}};
    p.xi = xi;
    p.mirror = is_mirror;
    p.min_angle = is_mirror ? 12 * kDegree : 0;
    p.max_angle = 100 * kDegree;
    return std::make_shared<UnifiedCamera>(p);
}

class CameraModel : public ::testing::TestWithParam<Named> {};

// Pixels of a fine grid that see the world, and those just inside the edge of the valid region.
std::vector<Vector2d> seeing_pixels(const Camera& camera) {
    std::vector<Vector2d> pixels;
    constexpr int kSteps = 60;
    const auto at = [&](int i, int j) {
        return Vector2d(i * (camera.width() - 1.0) / kSteps, j * (camera.height() - 1.0) / kSteps);
    };
    for (int j = 0; j <= kSteps; ++j)
        for (int i = 0; i <= kSteps; ++i) {
            if (camera.ray(at(i, j))) pixels.push_back(at(i, j));
            if (i == kSteps ||
                camera.ray(at(i, j)).has_value() == camera.ray(at(i + 1, j)).has_value())
                continue;
            Vector2d inside = at(i, j), outside = at(i + 1, j);
            if (!camera.ray(inside)) std::swap(inside, outside);
            for (int k = 0; k < 60; ++k) {
                const Vector2d middle = 0.5 * (inside + outside);
                (camera.ray(middle) ? inside : outside) = middle;
            }
            pixels.push_back(inside);
        }
    return pixels;
}

TEST_P(CameraModel, RayThenProjectReturnsThePixelUpToTheEdge) {
    const CameraPtr camera = GetParam().make();
    const auto pixels = seeing_pixels(*camera);
    ASSERT_GT(pixels.size(), 500u);
    double worst = 0;
    for (const Vector2d& uv : pixels)
        for (const double distance : {0.3, 2.7, 1e3, 1e6}) {
            const auto ray = camera->ray(uv);
            ASSERT_TRUE(ray);
            EXPECT_NEAR(ray->direction.norm(), 1, 1e-12);
            const auto back = camera->project(ray->origin + distance * ray->direction);
            ASSERT_TRUE(back) << uv.transpose() << " at " << distance << " m";
            worst = std::max(worst, (*back - uv).norm());
        }
    EXPECT_LT(worst, 1e-9);
}

TEST_P(CameraModel, JacobianMatchesCentralDifferences) {
    const CameraPtr camera = GetParam().make();
    const auto pixels = seeing_pixels(*camera);
    double worst = 0;
    for (std::size_t i = 0; i < pixels.size(); i += 7)
        for (const double distance : {0.4, 3.0, 30.0}) {
            const auto ray = camera->ray(pixels[i]);
            const Vector3d p = ray->origin + distance * ray->direction;
            Matrix23d J;
            ASSERT_TRUE(camera->project(p, &J));
            // Richardson's extrapolation of central differences.
            const auto f = [&](const Vector3d& d) { return *camera->project(p + d); };
            const double h = 2e-4 * distance;
            const Matrix23d numeric =
                (4 * test::numeric_jacobian<2, 3>(f, h / 2) - test::numeric_jacobian<2, 3>(f, h)) /
                3;
            worst = std::max(worst, (J - numeric).norm() / numeric.norm());
        }
    EXPECT_LT(worst, 1e-7);
}

INSTANTIATE_TEST_SUITE_P(
    Models, CameraModel,
    ::testing::Values(
        Named{"fisheye", [] { return fisheye(95 * kDegree); }},
        Named{"fisheye_wide", [] { return fisheye(1.9); }},
        Named{"fisheye_plain",
              [] {
                  return std::make_shared<FisheyeCamera>(
                      FisheyeParameters{600, 600, 110, 110, 300, 300, {}, 2.6});
              }},
        Named{"unified_perspective", [] { return unified(0, false); }},
        Named{"unified_wide", [] { return unified(1.4, false); }},
        Named{"unified_hyperbola", [] { return unified(0.9, true); }},
        Named{"unified_parabola", [] { return unified(1, true); }},
        Named{"equiangular", [] { return mirror(equiangular()); }},
        Named{"equiangular_misaligned", [] { return mirror(equiangular(), misaligned()); }},
        Named{"hyperbolic", [] { return mirror(hyperbolic()); }},
        Named{"hyperbolic_misaligned", [] { return mirror(hyperbolic(), misaligned()); }},
        Named{"parabolic", [] { return mirror(parabolic()); }},
        Named{"parabolic_misaligned", [] { return mirror(parabolic(), misaligned()); }}),
    [](const auto& model) { return model.param.name; });

TEST(FisheyeCamera, SeesBehindItself) {
    const auto camera = fisheye(100 * kDegree);
    const Vector3d p(1, 0, -0.1);
    const auto uv = camera->project(p);
    ASSERT_TRUE(uv);
    EXPECT_GT(uv->x(), 254.931 + 190 * 90 * kDegree);
    EXPECT_FALSE(camera->project({0, 0, -1}));
    EXPECT_FALSE(camera->project({0, 0, 0}));
}

TEST(FisheyeCamera, JacobianIsContinuousAtTheAxis) {
    const auto camera = fisheye(95 * kDegree);
    for (const double x : {0.0, 1e-9, 0.9e-6, 1.1e-6, 1e-4}) {
        const Vector3d p(x, 0.7 * x, 1.5);
        Matrix23d J;
        ASSERT_TRUE(camera->project(p, &J));
        const auto numeric = test::numeric_jacobian<2, 3>(
            [&](const Vector3d& d) { return *camera->project(p + d); }, 1e-4);
        EXPECT_LT((J - numeric).norm(), 1e-7 * numeric.norm()) << x;
    }
}

TEST(UnifiedCamera, WithoutXiIsThePerspectiveCamera) {
    const auto camera = std::static_pointer_cast<const UnifiedCamera>(unified(0, false));
    const PerspectiveCamera perspective(camera->parameters().lens);
    const Vector3d p(0.3, -0.2, 1.1);
    EXPECT_LT((*camera->project(p) - *perspective.project(p)).norm(), 1e-10);
}

// Ollis, Herman and Singh: the ray's angle is the image angle times the gain.
TEST(MirrorCamera, EquiangularMirrorHasConstantGain) {
    const auto camera = mirror(equiangular());
    for (double theta = 0.021; theta < 0.104; theta += 0.004) {
        const auto ray = camera->ray({319.5 + 2162 * std::tan(theta), 239.5});
        ASSERT_TRUE(ray) << theta;
        EXPECT_NEAR(std::atan2(ray->direction.x(), -ray->direction.z()), 17 * theta, 1e-12);
    }
}

TEST(MirrorCamera, SeesAboveItsHorizonAndNotItself) {
    const auto camera = mirror(equiangular());
    EXPECT_TRUE(camera->ray({319.5 + 2162 * std::tan(95 * kDegree / 17), 239.5}));
    EXPECT_FALSE(camera->ray({319.5, 239.5}));         // the camera itself
    EXPECT_FALSE(camera->ray({0, 0}));                 // beside the mirror
    EXPECT_FALSE(camera->project({0, 0, 0.5}));        // behind the mirror
    EXPECT_FALSE(camera->project({0.005, 0, 0.3}));    // hidden by it
    EXPECT_FALSE(camera->project({0.001, 0, 0.155}));  // inside it
    EXPECT_TRUE(camera->project({2, 0, 0.15}));
    EXPECT_TRUE(camera->project({2, 0, -1}));
}

// The law of reflection, checked without the code's own mathematics: angles of incidence and
// reflection with a normal from finite differences of the rays' origins.
TEST(MirrorCamera, RaysObeyTheLawOfReflection) {
    for (const auto& camera :
         {mirror(equiangular(), misaligned()), mirror(hyperbolic(), misaligned())}) {
        for (const Vector2d& uv : {Vector2d(400, 200), Vector2d(250, 330), Vector2d(420, 300)}) {
            const auto at = [&](double du, double dv) {
                return camera->ray(uv + Vector2d(du, dv))->origin;
            };
            const Vector3d n =
                (at(1e-3, 0) - at(-1e-3, 0)).cross(at(0, 1e-3) - at(0, -1e-3)).normalized();
            const auto ray = camera->ray(uv);
            const Vector3d in = ray->origin.normalized();
            EXPECT_NEAR((in - 2 * in.dot(n) * n - ray->direction).norm(), 0, 1e-7);
        }
    }
}

TEST(MirrorCamera, AlignedHyperbolaIsTheUnifiedModel) {
    const auto camera = mirror(hyperbolic());
    const double e = hyperbolic().eccentricity, focus = 2 * 0.15 * e / (1 + e);
    UnifiedParameters p;
    p.lens = mirror_lens();
    p.lens.fx = p.lens.fy = 1100 * (e * e - 1) / (e * e + 1);
    p.xi = 2 * e / (1 + e * e);
    p.mirror = true;
    const UnifiedCamera central(p);
    for (const Vector3d& d :
         {Vector3d(1, 0.3, -0.5), Vector3d(-0.2, 0.5, -0.8), Vector3d(1, 1, 0.1)}) {
        const auto uv = camera->project(d + Vector3d(0, 0, focus));
        ASSERT_TRUE(uv);
        EXPECT_LT((*uv - *central.project(d)).norm(), 1e-10);
    }
}

TEST(MirrorCamera, AlignedParabolaIsTheUnifiedModel) {
    const auto camera = mirror(parabolic());
    UnifiedParameters p;
    p.lens = mirror_lens();
    p.lens.fx = p.lens.fy = 10000 * parabolic().semi_latus_rectum;
    p.xi = 1;
    p.mirror = true;
    const UnifiedCamera central(p);
    const Vector3d focus(0, 0, 0.1 + parabolic().semi_latus_rectum / 2);
    for (const Vector3d& d :
         {Vector3d(1, 0.3, -0.5), Vector3d(-0.2, 0.5, -0.8), Vector3d(1, 1, 0.1)})
        EXPECT_LT((*camera->project(d + focus) - *central.project(d)).norm(), 1e-10);
}

TEST(MirrorCamera, JacobianByTheMirrorsPlaceMatchesCentralDifferences) {
    for (const auto& shape : {equiangular(), hyperbolic(), parabolic()}) {
        const auto camera =
            std::static_pointer_cast<const MirrorCamera>(mirror(shape, misaligned()));
        for (const Vector3d& p : {Vector3d(0.8, 0.3, -0.5), Vector3d(-0.6, 1, 0.1)}) {
            Eigen::Matrix<double, 2, 6> J;
            ASSERT_TRUE(camera->project(p, nullptr, &J));
            const auto f = [&](const Vector6d& d) {
                MirrorParameters moved = camera->parameters();
                moved.T_C_M = moved.T_C_M.boxplus(d);
                return *MirrorCamera(moved).project(p);
            };
            const Eigen::Matrix<double, 2, 6> numeric = (4 * test::numeric_jacobian<2, 6>(f, 1e-5) -
                                                         test::numeric_jacobian<2, 6>(f, 2e-5)) /
                                                        3;
            EXPECT_LT((J - numeric).norm(), 1e-7 * numeric.norm());
        }
    }
}

TEST(CameraModels, RefuseImpossibleParameters) {
    EXPECT_THROW(FisheyeCamera({512, 512, 190, 190, 256, 256, {-5, 0, 0, 0}, 0}), InputError);
    EXPECT_THROW(FisheyeCamera({0, 512, 190, 190, 256, 256, {}, 3}), InputError);
    UnifiedParameters negative;
    negative.lens = mirror_lens();
    negative.xi = -0.5;
    EXPECT_THROW(UnifiedCamera{negative}, InputError);
    auto flat = equiangular();
    flat.gain = 0.9;
    EXPECT_THROW(mirror(flat), InputError);
    auto large = equiangular();
    large.rim_radius = 0.15;
    EXPECT_THROW(mirror(large), InputError);
    auto inverted = equiangular();
    inverted.blind_radius = 0.02;
    EXPECT_THROW(mirror(inverted), InputError);
    EXPECT_THROW(mirror(equiangular(), Pose{so3::exp({1.5, 0, 0}), {}}), InputError);
}

}  // namespace
}  // namespace vio
