#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>
#include <utility>

#include "libvio/geometry/so3.h"
#include "libvio/tracking/ray_bundle.h"
#include "libvio/tracking/rigid_window.h"

namespace vio {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// A camera that swings before points 1 to 4 m away, one of them in a hundred at infinity.
class Swing {
 public:
    explicit Swing(double noise, double reach = 1) : noise_(noise), reach_(reach) {
        std::uniform_real_distribution<double> side(-1.5, 1.5), depth(1, 4);
        for (int i = 0; i < kPoints; ++i) {
            const double z = i % 100 ? depth(random_) : 1e9;
            points_.emplace_back(z * side(random_) / 2, z * side(random_) / 2, z);
        }
    }
    static constexpr int kPoints = 120;

    static Matrix3d R(int image) { return so3::exp(Vector3d(0.002, -0.004, 0.01) * image); }
    Vector3d p(int image) const {
        return reach_ * Vector3d(0.3 * std::sin(0.12 * image), 0.25 * std::cos(0.1 * image) - 0.25,
                                 0.01 * image);
    }
    Vector3d ray(int image, int point) {
        return noisy(R(image).transpose() * (points_[static_cast<std::size_t>(point)] - p(image)));
    }
    // Where a near edge crosses a far one: it slides along the far edge as the camera moves.
    Vector3d crossing(int image) {
        const Vector3d near(0.1, 0, 1), along_near(0.2, 1, 0), far(0, 0, 3), along_far(1, -0.3, 0);
        // The plane of the near edge and the camera meets the far edge.
        const Vector3d normal = (near - p(image)).cross(along_near);
        const double s = normal.dot(p(image) - far) / normal.dot(along_far);
        return noisy(R(image).transpose() * (far + s * along_far - p(image)));
    }
    std::vector<FeatureRay> rays(int image) {
        std::vector<FeatureRay> result;
        for (int i = 0; i < kPoints; ++i) result.push_back({i, ray(image, i)});
        return result;
    }

 private:
    Vector3d noisy(const Vector3d& direction) {
        std::normal_distribution<double> n(0, noise_);
        const Vector3d f = direction.normalized();
        return (f + Vector3d(n(random_), n(random_), n(random_))).normalized();
    }
    double noise_, reach_;
    std::mt19937 random_{5};
    std::vector<Vector3d> points_;
};

constexpr double kPixel = 1.0 / 500;  // [rad]

RayBundle bundle_of(Swing& swing, int views) {
    RayBundle bundle;
    for (int v = 0; v < views; ++v) bundle.T_W_C.push_back({Swing::R(3 * v), swing.p(3 * v)});
    for (int i = 0; i < Swing::kPoints; ++i) {
        bundle.points.emplace_back();
        for (int v = 0; v < views; ++v)
            bundle.points.back().rays.emplace_back(v, swing.ray(3 * v, i));
    }
    return bundle;
}

// With perfect rays the cost vanishes only at the true poses, but for scale: the steps of a wrong
// derivative would not lead there.
TEST(RayBundle, FindsTheTrueViewsFromPerfectRays) {
    Swing swing(0);
    RayBundle bundle = bundle_of(swing, 5);
    const std::vector<Pose> truth = bundle.T_W_C;
    std::mt19937 random(3);
    std::normal_distribution<double> n;
    for (std::size_t v = 1; v < truth.size(); ++v) {
        Vector6d d;
        for (int k = 0; k < 6; ++k) d[k] = 0.02 * n(random);
        bundle.T_W_C[v] = truth[v].boxplus(d);
    }
    for (RayBundle::Point& point : bundle.points) bundle.triangulate(point);
    double cost = 1;
    for (int k = 0; k < 5; ++k) cost = bundle.minimize(20);
    EXPECT_LT(cost, 1e-16);
    const Vector3d origin = truth[0].p;
    const double scale = (bundle.T_W_C.back().p - origin).norm() / (truth.back().p - origin).norm();
    for (std::size_t v = 1; v < truth.size(); ++v) {
        EXPECT_LT(so3::log(truth[v].R.transpose() * bundle.T_W_C[v].R).norm(), 1e-7);
        EXPECT_LT(((bundle.T_W_C[v].p - origin) / scale - (truth[v].p - origin)).norm(), 1e-7);
    }
}

TEST(RayBundle, PutsADistantPointAtItsDirection) {
    Swing swing(0);
    RayBundle bundle = bundle_of(swing, 4);
    RayBundle::Point& far = bundle.points[0];
    bundle.triangulate(far);
    EXPECT_LT(far.h[3], 1e-8);
    for (const RayBundle::Ray& ray : far.rays) EXPECT_LT(bundle.error(ray, far.h), 1e-8);
    bundle.triangulate(bundle.points[1]);
    EXPECT_GT(bundle.points[1].h[3], 0.1);
}

// The oldest view is not the only one that tells what is ahead: the camera may since have backed
// away over what the later views see.
TEST(RayBundle, PlacesAPointBehindTheFirstView) {
    const Vector3d point(0.1, 0.05, -1.5);
    RayBundle bundle;
    bundle.points.emplace_back();
    for (const double z : {0.0, -1.9, -2.1, -2.3}) {
        const Pose T_W_C{Matrix3d::Identity(), {0, 0, z}};
        if (z < 0)
            bundle.points[0].rays.emplace_back(static_cast<int>(bundle.T_W_C.size()),
                                               (T_W_C.inverse() * point).normalized());
        bundle.T_W_C.push_back(T_W_C);
    }
    bundle.triangulate(bundle.points[0]);
    const Eigen::Vector4d& h = bundle.points[0].h;
    EXPECT_LT((h.head<3>() / h[3] - point).norm(), 1e-8);
}

// Ids that the window named over a sequence of 60 images, with slides added as further features.
// So many images from the 20th on show the same place.
std::set<FeatureId> named(Swing& swing, bool with_crossing, int standing = 0) {
    RigidWindow window({.threshold = 1.5 * kPixel});
    std::set<FeatureId> result;
    int before = 0;
    for (int image = 0; image < 60 + standing; ++image) {
        const int i = image < 20 ? image : std::max(20, image - standing);
        std::vector<FeatureRay> rays = swing.rays(i);
        if (with_crossing) rays.push_back({1000, swing.crossing(i)});
        const Matrix3d R = Swing::R(std::exchange(before, i)).transpose() * Swing::R(i);
        for (const FeatureId id : window.check(rays, R)) result.insert(id);
        window.remember(rays);
    }
    return result;
}

TEST(RigidWindow, NamesTheApparentCrossingOfTwoEdgesAndNothingElse) {
    Swing swing(0.2 * kPixel);
    EXPECT_EQ(named(swing, true), std::set<FeatureId>{1000});
}

// As long as the camera stands, nothing new is known; what was known before must not be forgotten.
TEST(RigidWindow, KeepsGoodFeaturesWhereTheCameraStandsAndGoesOn) {
    for (const int standing : {8, 50}) {
        Swing swing(0.2 * kPixel);
        EXPECT_EQ(named(swing, true, standing), std::set<FeatureId>{1000}) << standing;
    }
}

// The camera runs along its x axis, and so does a point, back and forth: its rays fit the motion in
// every pair of images, but no single place.
TEST(RigidWindow, SeesWhatPairsOfImagesCannot) {
    std::mt19937 random(2);
    std::uniform_real_distribution<double> side(-1, 1), depth(1, 4);
    std::vector<Vector3d> points;
    for (int i = 0; i < 60; ++i) {
        const double z = depth(random);
        points.emplace_back(z * side(random), z * side(random), z);
    }
    const auto p = [](int image) { return Vector3d(0.02 * image, 0, 0); };
    const auto slider = [&](int image) -> Vector3d {
        return (Vector3d(0.05 * std::sin(0.2 * image), 0.1, 2) - p(image)).normalized();
    };
    RigidWindow window({.threshold = kPixel});
    std::set<FeatureId> wrong;
    for (int i = 0; i < 40; ++i) {
        for (const int gap : {1, 2, 4})
            EXPECT_LT(two_view_residual({slider(i), slider(i + gap)}, Matrix3d::Identity(),
                                        Vector3d::UnitX()),
                      1e-9);
        std::vector<FeatureRay> rays{{1000, slider(i)}};
        for (std::size_t k = 0; k < points.size(); ++k)
            rays.push_back({static_cast<FeatureId>(k), (points[k] - p(i)).normalized()});
        for (const FeatureId id : window.check(rays, Matrix3d::Identity())) wrong.insert(id);
        window.remember(rays);
    }
    EXPECT_EQ(wrong, std::set<FeatureId>{1000});
}

// Rotation alone: nothing is known of depth, and nothing is wrong.
TEST(RigidWindow, LeavesAPureRotationAlone) {
    Swing swing(0.2 * kPixel, 0);
    EXPECT_TRUE(named(swing, false).empty());
}

// Two scenes that move against each other: the window does not take sides at random.
TEST(RigidWindow, SaysNothingWithoutAMajority) {
    Swing swing(0.2 * kPixel), other(0.2 * kPixel, -1.5);
    RigidWindow window({.threshold = 1.5 * kPixel});
    for (int i = 0; i < 40; ++i) {
        std::vector<FeatureRay> rays = swing.rays(i), rest = other.rays(i);
        for (std::size_t k = 0; k < rays.size(); ++k)
            if (k % 2) rays[k].f = rest[k].f;
        const Matrix3d R = Swing::R(std::max(0, i - 1)).transpose() * Swing::R(i);
        EXPECT_LE(window.check(rays, R).size(), rays.size() / 2);
        window.remember(rays);
    }
}

}  // namespace
}  // namespace vio
