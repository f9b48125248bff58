// Images of calibration boards through any camera, by casting the rays of each pixel's samples onto
// the board's plane. Drawn from the patterns' definitions, not by the library that detects them.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "libvio/camera/camera.h"
#include "libvio/geometry/pose.h"
#include "libvio/simulation/random.h"

namespace vio::test {

/// Light of the plane z = 0 at x, y [m]: 0 black, 1 white.
struct Pattern {
    virtual ~Pattern() = default;
    virtual double light(double x, double y) const = 0;
};

/// As Kalibr prints it: tags of 10 x 10 bits, two of them black border, black squares where gaps
/// cross. y is up, z towards the viewer.
struct AprilGridPattern final : Pattern {
    int cols = 5, rows = 4;
    double tag_size = 0.088, spacing = 0.3;

    double light(double x, double y) const override {
        const double pitch = tag_size * (1 + spacing), gap = tag_size * spacing;
        if (x < -gap || y < -gap || x >= cols * pitch || y >= rows * pitch) return 1;
        const int i = static_cast<int>(std::floor(x / pitch)),
                  j = static_cast<int>(std::floor(y / pitch));
        const double u = x - i * pitch, v = y - j * pitch;
        if (u >= tag_size || v >= tag_size) return u >= tag_size && v >= tag_size ? 0 : 1;
        const int col = static_cast<int>(u / tag_size * 10) - 2,
                  row = 7 - static_cast<int>(v / tag_size * 10);
        if (col < 0 || col > 5 || row < 0 || row > 5) return 0;
        // The family tag36h11, most significant bit at the top left; set: white.
        static constexpr std::array<std::uint64_t, 20> kCodes{
            0xd5d628584, 0xd97f18b49, 0xdd280910e, 0xe479e9c98, 0xebcbca822,
            0xf31dab3ac, 0x056a5d085, 0x10652e1d4, 0x22b1dfead, 0x265ad0472,
            0x34fe91b86, 0x3ff962cd5, 0x43a25329a, 0x474b4385f, 0x4e9d243e9,
            0x5246149ae, 0x5997f5538, 0x683bb6c4c, 0x6be4a7211, 0x7e3158eea};
        return kCodes.at(j * cols + i) >> (35 - 6 * row - col) & 1 ? 1 : 0;
    }
};

/// The square between the first four inner corners is black. y is down, z into the board.
struct CheckerboardPattern final : Pattern {
    int cols = 8, rows = 5;
    double spacing = 0.06;

    double light(double x, double y) const override {
        const int i = static_cast<int>(std::floor(x / spacing)),
                  j = static_cast<int>(std::floor(y / spacing));
        if (i < -1 || j < -1 || i >= cols || j >= rows) return 1;
        return (i + j) % 2 == 0 ? 0 : 1;
    }
};

class BoardRenderer {
 public:
    BoardRenderer(const Camera& camera, const Pattern& pattern, int samples = 4)
        : width_(camera.width()), height_(camera.height()), samples_(samples), pattern_(pattern) {
        for (int v = 0; v < height_; ++v)
            for (int u = 0; u < width_; ++u)
                for (int s = 0; s < samples * samples; ++s) {
                    const auto ray = camera.ray({u - 0.5 + (s % samples + 0.5) / samples,
                                                 v - 0.5 + (s / samples + 0.5) / samples});
                    rays_.push_back(ray ? *ray : Ray{{0, 0, 0}, {0, 0, 0}});
                }
    }

    /// Board G's plane from the camera's pose; grey beside the board and noise of 2 grey levels.
    cv::Mat image(const Pose& T_G_C, std::uint64_t seed) const {
        cv::Mat image(height_, width_, CV_8UC1);
        Random random(seed, "board image");
        std::size_t k = 0;
        for (int v = 0; v < height_; ++v)
            for (int u = 0; u < width_; ++u) {
                double sum = 0;
                for (int s = 0; s < samples_ * samples_; ++s) sum += light(T_G_C, rays_[k++]);
                const double level = 30 + 190 * sum / (samples_ * samples_) + 2 * random.normal();
                image.at<std::uint8_t>(v, u) = cv::saturate_cast<std::uint8_t>(level);
            }
        return image;
    }

 private:
    double light(const Pose& T_G_C, const Ray& ray) const {
        const Eigen::Vector3d origin = T_G_C * ray.origin, d = T_G_C.R * ray.direction;
        const double distance = -origin.z() / d.z();
        if (!(distance > 0) || !std::isfinite(distance)) return 0.5;
        const double x = origin.x() + distance * d.x(), y = origin.y() + distance * d.y();
        constexpr double kSheet = 2;  // [m]: what is beyond is no board
        if (std::abs(x) > kSheet || std::abs(y) > kSheet) return 0.5;
        return pattern_.light(x, y);
    }

    int width_, height_, samples_;
    const Pattern& pattern_;
    std::vector<Ray> rays_;
};

/// Camera poses before a board of the given extent, seen from its front (z up or down), near,
/// tilted and turned.
inline std::vector<Pose> poses_before(double width, double height, bool z_to_viewer, int count,
                                      double nearest, double farthest, std::uint64_t seed) {
    Random random(seed, "board poses");
    std::vector<Pose> poses;
    const Eigen::Vector3d middle(width / 2, height / 2, 0);
    const double side = z_to_viewer ? 1 : -1;
    Eigen::Matrix3d front = Eigen::Matrix3d::Identity();  // R_G_C
    if (z_to_viewer) front.diagonal() << 1, -1, -1;
    for (int i = 0; i < count; ++i) {
        const Eigen::Matrix3d tilt =
            so3::exp({0.5 * random.normal(), 0.5 * random.normal(), 0.4 * random.normal()});
        Pose T_G_C;
        T_G_C.R = tilt * front;
        const double distance = random.uniform(nearest, farthest);
        if (side * -T_G_C.R(2, 2) < 0.6) {  // too oblique to be of use
            --i;
            continue;
        }
        // The board's middle somewhere in the image.
        const Eigen::Vector3d aim(0.35 * distance * random.uniform(-1, 1),
                                  0.25 * distance * random.uniform(-1, 1), distance);
        T_G_C.p = middle - T_G_C.R * aim;
        poses.push_back(T_G_C);
    }
    return poses;
}

}  // namespace vio::test
