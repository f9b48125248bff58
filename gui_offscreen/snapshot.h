// Pictures of scenes, made without a display.
#pragma once

#include <mrpt/opengl/COpenGLScene.h>

#include <Eigen/Dense>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "libvio/geometry/pose.h"

namespace vio {

/// Where the scene is looked at from; axes of W.
enum class View {
    kTop,    ///< from above, x to the right
    kSide,   ///< level, along +y
    kIso,    ///< obliquely from above
    kChase,  ///< from behind and above the last pose
};

/// "top", "side", "iso" or "chase"; nothing for another word.
std::optional<View> parse_view(const std::string& word);

/// What View::kChase looks at.
struct ChasePoint {
    Eigen::Vector3d position;  ///< of the camera that is followed, in W [m]
    Eigen::Vector3d forward;   ///< horizontal direction in which it goes, of any length
    double extent = 0;         ///< of the whole path [m]; 0: of the path in the scene
};

/// Horizontal part of where a camera looks; its x axis where it looks straight down or up.
Eigen::Vector3d chase_direction(const Pose& T_W_C);

/// Size and point of view of a picture.
struct SnapshotOptions {
    int width = 1280, height = 720;  ///< [px]
    View view = View::kIso;
    std::optional<ChasePoint> chase;  ///< instead of the scene's newest camera
    double turn = 0;                  ///< further rotation about z, for turntables [rad]
    int supersampling = 2;            ///< samples per pixel and axis, for smooth edges
    bool legend = true;               ///< names, colours and scale in a corner
};

/// A picture, or why there is none.
struct Snapshot {
    cv::Mat image;        ///< 8-bit BGR; empty if off-screen OpenGL cannot start
    std::string problem;  ///< one line: what failed and what to install; empty if there is an image
};

/// Renders scenes of one picture size through an off-screen OpenGL (EGL) context.
/// Keep one and reuse it: starting takes far longer than a picture. At most one may be alive in a
/// thread, and it must be used in the thread that made it.
class SnapshotRenderer {
 public:
    SnapshotRenderer(int width, int height, int supersampling = 2);
    ~SnapshotRenderer();
    SnapshotRenderer(const SnapshotRenderer&) = delete;
    SnapshotRenderer& operator=(const SnapshotRenderer&) = delete;

    /// Whether off-screen OpenGL started, else why not and what to install.
    const std::string& problem() const;

    /// Picture of the whole path and the landmarks near it. Width, height and supersampling of the
    /// options are not looked at: they are the renderer's.
    Snapshot render(const mrpt::opengl::COpenGLScene::Ptr& scene, const SnapshotOptions& options);

 private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// One picture with a renderer of its own.
Snapshot render_snapshot(const mrpt::opengl::COpenGLScene::Ptr& scene,
                         const SnapshotOptions& options = {});

/// Writes PNG (or what the extension says); throws InputError if it cannot be written.
void save_image(const cv::Mat& image, const std::string& file);

}  // namespace vio
