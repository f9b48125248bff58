// Estimates as 3-D scenes.
#pragma once

#include <mrpt/opengl/COpenGLScene.h>

#include <Eigen/Dense>
#include <optional>
#include <string>
#include <vector>

#include "libvio/base/estimate.h"
#include "libvio/io/landmark_colour.h"

namespace vio {

/// A second path to draw beside the estimate: truth, odometry, another run.
struct NamedPath {
    std::string name;  ///< for the legend
    std::vector<TimedPose> poses;
};

/// What of an estimate is drawn, and how; lengths in metres, W is the scene's frame.
struct SceneOptions {
    bool dark = false;              ///< dark background instead of white
    std::string name = "estimate";  ///< of the estimated path, for the legend
    /// Frusta: camera in body frame, and half its field of view as tangents (x, y).
    Pose T_B_C;
    Eigen::Vector2d half_view = {0.5, 0.35};
    int max_frusta = 40;      ///< evenly spread over the path
    int max_ellipsoids = 20;  ///< poses whose 3-sigma ellipsoid is drawn, evenly spread
    double ellipsoid_sigmas = 3;
    LandmarkColour landmark_colour = LandmarkColour::kUncertainty;
    /// Draw the estimate's path up to this time only; sizes and grid stay those of the whole.
    std::optional<TimeNs> until;
};

/// Diagonal of the box around all paths [m], at least 0.1.
double path_extent(const Estimate& estimate, const std::vector<NamedPath>& others);

/// Scene in the estimate's world: grid, axes, path as a tube (lost stretches in red), other paths,
/// camera frusta, landmarks coloured by uncertainty or as in the images, position ellipsoids
/// (unless all hide in the tube), gravity.
///
/// Lines are thin meshes, since OpenGL's line width is not honoured everywhere; their thickness
/// follows the extent of the path. Objects carry names: render_snapshot() makes the legend and the
/// framing from names that begin with "path " and "landmarks", so a scene that was saved and loaded
/// gives the same picture. Poses and landmarks that are not finite are left out.
mrpt::opengl::COpenGLScene::Ptr build_scene(const Estimate& estimate,
                                            const SceneOptions& options = {},
                                            const std::vector<NamedPath>& others = {});

/// Writes a .3Dscene for SceneViewer3D; throws InputError if the file cannot be written.
void save_scene(const mrpt::opengl::COpenGLScene& scene, const std::string& file);
/// Throws InputError for a missing or foreign file.
mrpt::opengl::COpenGLScene::Ptr load_scene(const std::string& file);

}  // namespace vio
