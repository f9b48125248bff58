// Cost of projecting one point, with and without Jacobian, and of one ray, for each camera model.
#include <benchmark/benchmark.h>

#include <vector>

#include "libvio/camera/fisheye.h"
#include "libvio/camera/mirror.h"
#include "libvio/camera/unified.h"

namespace vio {
namespace {

CameraPtr make(int model) {
    PerspectiveParameters lens{640, 480, 2162, 2162, 319.5, 239.5, {}};
    const PerspectiveParameters distorted{
        752, 480, 458.654, 457.296, 367.215, 248.375, {-0.283, 0.0739, 1.9e-4, 1.8e-5}};
    MirrorParameters mirror;
    mirror.lens = lens;
    mirror.shape.apex_distance = 0.15;
    mirror.shape.gain = 17;
    mirror.shape.rim_radius = 0.0166;
    mirror.shape.blind_radius = 0.003;
    if (model >= 4) mirror.T_C_M = {so3::exp({0.02, -0.015, 0.1}), {0.001, -0.0015, 0.003}};
    switch (model) {
        case 0:
            return std::make_shared<PerspectiveCamera>(distorted);
        case 1:
            return std::make_shared<FisheyeCamera>(FisheyeParameters{
                512, 512, 191, 191, 255, 257, {0.0035, 0.0007, -0.002, 0.0002}, 1.6});
        case 2:
            return std::make_shared<UnifiedCamera>(UnifiedParameters{distorted, 0.9});
        case 3:
        case 4:
            return std::make_shared<MirrorCamera>(mirror);
        default:
            mirror.lens.fx = mirror.lens.fy = 1100;
            mirror.shape.kind = MirrorShapeParameters::Kind::kHyperbolic;
            mirror.shape.eccentricity = 1.25;
            mirror.shape.rim_radius = 0.04;
            return std::make_shared<MirrorCamera>(mirror);
    }
}

const char* const kNames[] = {
    "perspective",           "fisheye", "unified", "equiangular", "equiangular, misaligned",
    "hyperbolic, misaligned"};

void prepare(benchmark::State& state, std::vector<Eigen::Vector2d>& pixels,
             std::vector<Eigen::Vector3d>& points, const Camera& camera) {
    for (int v = 0; v < camera.height(); v += 7)
        for (int u = 0; u < camera.width(); u += 7)
            if (const auto ray = camera.ray({u, v})) {
                const double distance = 0.5 + (u * 31 + v * 17) % 50 * 0.1;
                pixels.push_back({u, v});
                points.push_back(ray->origin + distance * ray->direction);
            }
    state.SetLabel(kNames[state.range(0)]);
}

template <bool kWithJacobian>
void project(benchmark::State& state) {
    const CameraPtr camera = make(static_cast<int>(state.range(0)));
    std::vector<Eigen::Vector2d> pixels;
    std::vector<Eigen::Vector3d> points;
    prepare(state, pixels, points, *camera);
    std::size_t i = 0;
    Matrix23d J;
    for (auto _ : state) {
        benchmark::DoNotOptimize(camera->project(points[i], kWithJacobian ? &J : nullptr));
        i = i + 1 < points.size() ? i + 1 : 0;
    }
}

void ray(benchmark::State& state) {
    const CameraPtr camera = make(static_cast<int>(state.range(0)));
    std::vector<Eigen::Vector2d> pixels;
    std::vector<Eigen::Vector3d> points;
    prepare(state, pixels, points, *camera);
    std::size_t i = 0;
    for (auto _ : state) {
        benchmark::DoNotOptimize(camera->ray(pixels[i]));
        i = i + 1 < pixels.size() ? i + 1 : 0;
    }
}

BENCHMARK(project<false>)->Name("camera/project")->DenseRange(0, 5);
BENCHMARK(project<true>)->Name("camera/project_jacobian")->DenseRange(0, 5);
BENCHMARK(ray)->Name("camera/ray")->DenseRange(0, 5);

}  // namespace
}  // namespace vio
