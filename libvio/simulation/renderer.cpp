#include "libvio/simulation/renderer.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <numbers>
#include <thread>

#include "libvio/base/at_once.h"
#include "libvio/simulation/random.h"

namespace vio {
namespace {

constexpr int kTileWidth = 32, kTileHeight = 16;

// Runs work(i) for i in 0..n-1 on several threads.
template <typename Work>
void in_parallel(int n, int threads, const Work& work) {
    if (threads <= 0) threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
    std::atomic<int> next{0};
    at_once(std::min(n, threads), [&](int) {
        for (int i = next++; i < n; i = next++) work(i);
    });
}

// Quantiles of the standard normal at (i + 1/2) / 65536: a normal deviate from 16 random bits.
const std::vector<float>& normal_quantiles() {
    static const std::vector<float> table = [] {
        std::vector<float> q(65536);
        double z = -4.5;
        for (int i = 0; i < 65536; ++i) {
            const double p = (i + 0.5) / 65536;
            for (int k = 0; k < 60; ++k) {  // Newton from the previous quantile
                const double error = 0.5 * std::erfc(-z / std::numbers::sqrt2) - p;
                const double density = std::exp(-z * z / 2) / std::sqrt(2 * std::numbers::pi);
                const double step = std::clamp(error / density, -0.3, 0.3);
                z -= step;
                if (std::abs(step) < 1e-12) break;
            }
            q[i] = static_cast<float>(z);
        }
        return q;
    }();
    return table;
}

double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    return std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace

Renderer::Renderer(const Scene& scene, CameraPtr camera, const RenderOptions& options)
    : scene_(scene), camera_(std::move(camera)), options_(options) {
    options_.samples = std::max(1, options_.samples);
    sample_angle_ = camera_->angular_resolution() / options_.samples;
    compute_rays();
    compute_tiles();
    for (const Solid& solid : scene_.solids())
        bounds_.push_back({solid.T_W_S.p, origin_spread_ + (solid.shape == Solid::Shape::kBox
                                                                ? solid.half_extent.norm()
                                                                : solid.half_extent.maxCoeff())});
}

void Renderer::compute_rays() {
    const int w = camera_->width(), h = camera_->height(), n = options_.samples;
    const size_t count = static_cast<size_t>(n) * n * w * h;
    directions_.assign(count, Eigen::Vector3f::Zero());
    std::vector<Eigen::Vector3f> origins(count, Eigen::Vector3f::Zero());
    in_parallel(n * n * h, options_.threads, [&](int i) {
        const int row = i % h, sample = i / h, sx = sample % n, sy = sample / n;
        const double du = (sx + 0.5) / n - 0.5;
        const double dv = ((sy + 0.5) / n - 0.5) * options_.row_fill;
        for (int column = 0; column < w; ++column) {
            const auto ray = camera_->ray({column + du, row + dv});
            if (!ray) continue;
            const size_t k = static_cast<size_t>(i) * w + column;
            directions_[k] = ray->direction.cast<float>();
            origins[k] = ray->origin.cast<float>();
        }
    });
    for (const Eigen::Vector3f& origin : origins)
        origin_spread_ = std::max(origin_spread_, static_cast<double>(origin.norm()));
    if (origin_spread_ > 0) origins_ = std::move(origins);
}

void Renderer::compute_tiles() {
    const int w = camera_->width(), h = camera_->height();
    const int patterns = options_.samples * options_.samples;
    for (int y = 0; y < h; y += kTileHeight)
        for (int x = 0; x < w; x += kTileWidth) {
            Tile tile;
            tile.pixels = {x, y, std::min(kTileWidth, w - x), std::min(kTileHeight, h - y)};
            const auto for_each_ray = [&](const auto& visit) {
                for (int s = 0; s < patterns; ++s)
                    for (int r = y; r < y + tile.pixels.height; ++r)
                        for (int c = x; c < x + tile.pixels.width; ++c) {
                            const auto& d = directions_[(static_cast<size_t>(s) * h + r) * w + c];
                            if (!d.isZero(0)) visit(Eigen::Vector3d(d.cast<double>()));
                        }
            };
            Eigen::Vector3d sum = Eigen::Vector3d::Zero();
            for_each_ray([&](const Eigen::Vector3d& d) { sum += d; });
            if (sum.isZero(0)) continue;
            tile.axis = sum.normalized();
            tile.half_angle = 0;
            for_each_ray([&](const Eigen::Vector3d& d) {
                tile.half_angle = std::max(tile.half_angle, angle_between(tile.axis, d));
            });
            tiles_.push_back(tile);
        }
}

// Solids whose bounding sphere meets the tile's cone.
std::vector<int> Renderer::candidates(const Tile& tile, const Pose& T_W_C) const {
    const Eigen::Vector3d axis = T_W_C.R * tile.axis;
    const double cos_half = std::cos(tile.half_angle), sin_half = std::sin(tile.half_angle);
    std::vector<int> result;
    for (int i = 0; i < static_cast<int>(bounds_.size()); ++i) {
        const Eigen::Vector3d to = bounds_[i].centre_W - T_W_C.p;
        const double radius = bounds_[i].radius, distance = to.norm();
        if (distance <= radius) {
            result.push_back(i);
            continue;
        }
        // Angle between axis and `to` <= half angle + asin(radius / distance).
        const double s = radius / distance, c = std::sqrt(1 - s * s);
        const double sin_sum = sin_half * c + cos_half * s, cos_sum = cos_half * c - sin_half * s;
        const bool beyond_pi = sin_sum <= 0;  // both angles are below pi
        if (beyond_pi || axis.dot(to) >= (cos_sum - 1e-6) * distance) result.push_back(i);
    }
    return result;
}

void Renderer::render_tile(const Tile& tile, const std::vector<Pose>& T_W_C, cv::Mat& sums) const {
    const int w = camera_->width(), h = camera_->height();
    for (int s = 0; s < static_cast<int>(T_W_C.size()); ++s) {
        const Pose& pose = T_W_C[s];
        const std::vector<int> solids = candidates(tile, pose);
        for (int r = tile.pixels.y; r < tile.pixels.br().y; ++r) {
            float* sum = sums.ptr<float>(r);
            for (int c = tile.pixels.x; c < tile.pixels.br().x; ++c) {
                const size_t k = (static_cast<size_t>(s) * h + r) * w + c;
                if (directions_[k].isZero(0)) continue;
                const Eigen::Vector3d direction = pose.R * directions_[k].cast<double>();
                const Eigen::Vector3d origin =
                    origins_.empty() ? pose.p : Eigen::Vector3d(pose * origins_[k].cast<double>());
                const auto hit = scene_.cast(origin, direction, &solids);
                sum[c] += static_cast<float>(hit ? scene_.intensity(*hit, sample_angle_)
                                                 : scene_.sky(direction));
            }
        }
    }
}

void Renderer::expose(const cv::Mat& sums, std::uint64_t noise_seed, cv::Mat& image) const {
    const std::vector<float>& quantile = normal_quantiles();
    const double cx = (image.cols - 1) / 2.0, cy = (image.rows - 1) / 2.0;
    const double corner2 = cx * cx + cy * cy, scale = 1.0 / (options_.samples * options_.samples);
    const double read2 = options_.read_noise * options_.read_noise;
    const double shot2 = options_.shot_noise * options_.shot_noise / 255;
    const long step = std::max(1, options_.grey_step);
    in_parallel(image.rows, options_.threads, [&](int r) {
        const float* sum = sums.ptr<float>(r);
        std::uint8_t* out = image.ptr<std::uint8_t>(r);
        for (int c = 0; c < image.cols; ++c) {
            const double r2 = ((c - cx) * (c - cx) + (r - cy) * (r - cy)) / corner2;
            const double light = sum[c] * scale * (1 - options_.vignetting * r2);
            const std::uint64_t bits =
                mixed(noise_seed ^ mixed(static_cast<std::uint64_t>(r) * image.cols + c));
            const double noise = std::sqrt(read2 + shot2 * light) * quantile[bits & 0xffff];
            out[c] = static_cast<std::uint8_t>(
                std::clamp(step * std::lround((light + noise) / step), 0L, 255L));
        }
    });
}

cv::Mat Renderer::image(double t, const std::function<Pose(double)>& T_W_C_at,
                        std::uint64_t noise_seed) const {
    const int patterns = options_.samples * options_.samples;
    std::vector<Pose> T_W_C;  // of each sample pattern: the exposure is spread over the patterns
    for (int s = 0; s < patterns; ++s)
        T_W_C.push_back(T_W_C_at(t + options_.exposure * ((s + 0.5) / patterns - 0.5)));
    cv::Mat sums = cv::Mat::zeros(camera_->height(), camera_->width(), CV_32F);
    in_parallel(static_cast<int>(tiles_.size()), options_.threads,
                [&](int i) { render_tile(tiles_[i], T_W_C, sums); });
    cv::Mat result(sums.size(), CV_8U);
    expose(sums, noise_seed, result);
    return result;
}

}  // namespace vio
