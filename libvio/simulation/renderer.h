// Images of a scene through any camera model, by ray casting.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <functional>
#include <opencv2/core.hpp>
#include <vector>

#include "libvio/camera/camera.h"
#include "libvio/geometry/pose.h"
#include "libvio/simulation/scene.h"

namespace vio {

/// How light becomes grey values.
struct RenderOptions {
    int samples = 2;        ///< per pixel and axis
    double exposure = 0;    ///< [s]; motion during it blurs the image
    double read_noise = 0;  ///< standard deviation [grey levels]
    double shot_noise = 0;  ///< standard deviation at white [grey levels], ~ sqrt(intensity)
    double vignetting = 0;  ///< loss of light in the image's corners [-], 0 to 1
    double row_fill = 1;    ///< share of a row's height that is sensitive: 0.5 for a single field
    int grey_step = 1;      ///< quantisation [grey levels]
    int threads = 0;        ///< 0: one per processor; the image does not depend on it
};

/// Draws grey images. The rays of all samples are computed once.
class Renderer {
 public:
    /// The scene must outlive the renderer.
    Renderer(const Scene& scene, CameraPtr camera, const RenderOptions& options);

    /// Image taken at time t [s], the middle of the exposure. T_W_C_at gives the camera's pose at a
    /// time [s]; it is called before threads start. noise_seed: noise differs with it.
    cv::Mat image(double t, const std::function<Pose(double)>& T_W_C_at,
                  std::uint64_t noise_seed) const;

 private:
    /// A rectangle of pixels and a cone about the rays of one sample pattern in it.
    struct Tile {
        cv::Rect pixels;
        Eigen::Vector3d axis;  ///< in C
        double half_angle;     ///< [rad]
    };

    /// A ball that holds a solid, with room for the spread of the rays' origins.
    struct Ball {
        Eigen::Vector3d centre_W;
        double radius;
    };

    void compute_rays();
    void compute_tiles();
    std::vector<int> candidates(const Tile& tile, const Pose& T_W_C) const;
    void render_tile(const Tile& tile, const std::vector<Pose>& T_W_C, cv::Mat& sums) const;
    void expose(const cv::Mat& sums, std::uint64_t noise_seed, cv::Mat& image) const;

    const Scene& scene_;
    CameraPtr camera_;
    RenderOptions options_;
    double sample_angle_;                      ///< [rad]
    double origin_spread_ = 0;                 ///< largest distance of a ray's origin from C's [m]
    std::vector<Eigen::Vector3f> directions_;  ///< [sample][row][column]; zero: no light gets there
    std::vector<Eigen::Vector3f> origins_;     ///< likewise; empty for a single viewpoint
    std::vector<Tile> tiles_;
    std::vector<Ball> bounds_;  ///< of the scene's solids
};

}  // namespace vio
