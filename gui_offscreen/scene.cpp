#include "gui_offscreen/scene.h"

#include <mrpt/opengl/CGridPlaneXY.h>
#include <mrpt/opengl/CPointCloudColoured.h>
#include <mrpt/poses/CPose3D.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "gui_offscreen/framing.h"
#include "gui_offscreen/mesh.h"
#include "gui_offscreen/palette.h"
#include "libvio/base/errors.h"
#include "libvio/base/files.h"

namespace vio {
namespace {

using Eigen::Vector3d;
using mrpt::img::TColor;
using mrpt::opengl::COpenGLScene;
using mrpt::opengl::CSetOfTriangles;

/// Sizes of what is drawn follow the extent of the paths.
struct Sizes {
    double extent;  ///< diagonal of the paths' bounding box [m]
    double path_radius() const { return 0.0042 * extent; }
    double edge_radius() const { return 0.0009 * extent; }
    double frustum_depth() const { return 0.05 * extent; }
    double axis_length() const { return 0.09 * extent; }
};

TColor with_alpha(TColor color, uint8_t alpha) {
    color.A = alpha;
    return color;
}

CSetOfTriangles::Ptr make_mesh(const std::string& name, const TColor& color) {
    auto mesh = CSetOfTriangles::Create();
    mesh->setName(name);
    mesh->setColor_u8(color);
    return mesh;
}

std::vector<StateEstimate> finite_states(const Estimate& estimate) {
    std::vector<StateEstimate> states = estimate.states;
    std::erase_if(states, [](const StateEstimate& s) {
        return !s.T_W_B.p.allFinite() || !s.T_W_B.R.allFinite();
    });
    return states;
}

/// `count` indices evenly spread over n, first and last among them.
std::vector<size_t> evenly(size_t n, int count) {
    std::vector<size_t> indices;
    if (n == 0 || count <= 0) return indices;
    const size_t k = std::min(n, static_cast<size_t>(count));
    for (size_t i = 0; i < k; ++i) indices.push_back(k == 1 ? n - 1 : i * (n - 1) / (k - 1));
    return indices;
}

/// Adds the points as a tube, leaving out those that hardly move on.
void add_path(CSetOfTriangles& mesh, const std::vector<Vector3d>& points, double radius,
              const TColor& color) {
    std::vector<Vector3d> kept;
    for (const Vector3d& p : points)
        if (p.allFinite() && (kept.empty() || (p - kept.back()).norm() > 0.4 * radius))
            kept.push_back(p);
    mesh::add_tube(mesh, kept, radius, color);
}

void add_estimate_path(COpenGLScene& scene, const std::vector<StateEstimate>& states,
                       const std::string& name, const Sizes& sizes, const Palette& colors) {
    auto tracked = make_mesh("path " + name, colors.estimate);
    auto lost = make_mesh("path lost", colors.lost);
    std::vector<Vector3d> stretch;
    for (size_t i = 0; i < states.size(); ++i) {
        stretch.push_back(states[i].T_W_B.p);
        const bool ends = i + 1 == states.size() || states[i + 1].lost != states[i].lost;
        if (!ends) continue;
        if (i + 1 < states.size()) stretch.push_back(states[i + 1].T_W_B.p);
        if (states[i].lost)
            add_path(*lost, stretch, 1.3 * sizes.path_radius(), colors.lost);
        else
            add_path(*tracked, stretch, sizes.path_radius(), colors.estimate);
        stretch.clear();
    }
    if (!states.empty())
        mesh::add_ellipsoid(*tracked, states.front().T_W_B.p,
                            2 * sizes.path_radius() * Eigen::Matrix3d::Identity(), colors.estimate);
    scene.insert(tracked);
    if (lost->getTrianglesCount() > 0) scene.insert(lost);
}

void add_frustum(CSetOfTriangles& mesh, const Pose& T_F_C, const SceneOptions& options,
                 double depth, double edge_radius, const TColor& color) {
    const Vector3d apex = T_F_C.p;
    std::vector<Vector3d> corners;
    for (const auto& [sx, sy] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, 1}})
        corners.push_back(T_F_C * Vector3d(depth * sx * options.half_view.x(),
                                           depth * sy * options.half_view.y(), depth));
    for (size_t i = 0; i < 4; ++i) {
        mesh::add_tube(mesh, {apex, corners[i]}, edge_radius, color, 5);
        mesh::add_tube(mesh, {corners[i], corners[(i + 1) % 4]}, edge_radius, color, 5);
    }
}

void add_frusta(COpenGLScene& scene, const std::vector<StateEstimate>& states,
                const SceneOptions& options, const Sizes& sizes, const Palette& colors) {
    if (states.empty()) return;
    auto frusta = make_mesh("cameras", colors.frustum);
    for (size_t i : evenly(states.size(), options.max_frusta))
        add_frustum(*frusta, states[i].T_W_B * options.T_B_C, options, sizes.frustum_depth(),
                    sizes.edge_radius(), colors.frustum);
    scene.insert(frusta);

    // The newest camera carries its pose, by which the chase view finds it.
    auto newest = make_mesh("newest camera", colors.estimate);
    add_frustum(*newest, Pose(), options, 1.8 * sizes.frustum_depth(), 2.2 * sizes.edge_radius(),
                colors.estimate);
    const Pose T_W_C = states.back().T_W_B * options.T_B_C;
    newest->setPose(mrpt::poses::CPose3D::FromRotationAndTranslation(T_W_C.R, T_W_C.p));
    scene.insert(newest);
}

std::string landmarks_name(const UncertaintyScale& scale) {
    if (scale.empty()) return "landmarks";
    char name[64];
    std::snprintf(name, sizeof(name), "landmarks, sigma %.2g to %.2g m", scale.low(), scale.high());
    return name;
}

void add_landmarks(COpenGLScene& scene, const Estimate& estimate, const SceneOptions& options) {
    const bool as_seen = options.landmark_colour == LandmarkColour::kImage;
    std::vector<double> sigmas;
    for (const LandmarkEstimate& landmark : estimate.landmarks)
        sigmas.push_back(position_sigma(landmark));
    const UncertaintyScale scale(sigmas);
    auto cloud = mrpt::opengl::CPointCloudColoured::Create();
    cloud->setPointSize(estimate.landmarks.size() > 2000 ? 3.f : 4.f);
    cloud->setName(as_seen ? "landmarks, colours of the images" : landmarks_name(scale));
    cloud->reserve(estimate.landmarks.size());
    for (const LandmarkEstimate& landmark : estimate.landmarks) {
        if (!landmark.p_W.allFinite()) continue;
        TColor color = palette(options.dark).frustum;  // where nothing is known
        if (as_seen && landmark.rgb)
            color = to_color(*landmark.rgb);
        else if (const double sigma = position_sigma(landmark); !as_seen && sigma > 0)
            color = to_color(uncertainty_colour(scale.share(sigma), options.dark));
        const Eigen::Vector3f p = landmark.p_W.cast<float>();
        cloud->push_back(p.x(), p.y(), p.z(), color.R / 255.f, color.G / 255.f, color.B / 255.f);
    }
    if (!cloud->empty()) scene.insert(cloud);
}

/// None where all of them would hide in the path's tube.
void add_ellipsoids(COpenGLScene& scene, const std::vector<StateEstimate>& states,
                    const SceneOptions& options, const Sizes& sizes, const Palette& colors) {
    char name[48];
    std::snprintf(name, sizeof(name), "position, %.3g sigma", options.ellipsoid_sigmas);
    const TColor color = with_alpha(colors.ellipsoid, 90);
    auto mesh = make_mesh(name, color);
    double longest = 0;
    for (size_t i : evenly(states.size(), options.max_ellipsoids)) {
        const Eigen::Matrix3d C = states[i].covariance.block<3, 3>(kPosition, kPosition);
        const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(C);
        if (!C.allFinite() || !(eigen.eigenvalues().maxCoeff() > 0)) continue;
        const Vector3d axes =
            options.ellipsoid_sigmas * eigen.eigenvalues().cwiseMax(0).cwiseSqrt();
        longest = std::max(longest, axes.maxCoeff());
        mesh::add_ellipsoid(*mesh, states[i].T_W_B.p, eigen.eigenvectors() * axes.asDiagonal(),
                            color);
    }
    if (longest > sizes.path_radius()) scene.insert(mesh);
}

void add_arrow(CSetOfTriangles& mesh, const Vector3d& from, const Vector3d& to, double radius,
               const TColor& color) {
    const Vector3d neck = from + 0.75 * (to - from);
    mesh::add_tube(mesh, {from, neck}, radius, color, 10);
    mesh::add_cone(mesh, neck, to, 2.6 * radius, color);
}

void add_axes_and_gravity(COpenGLScene& scene, const Estimate& estimate, const Sizes& sizes,
                          const Palette& colors) {
    const double length = sizes.axis_length(), radius = 0.6 * sizes.path_radius();
    auto axes = make_mesh("world axes", colors.text);
    const std::array<TColor, 3> rgb = {TColor(214, 48, 49), TColor(46, 160, 67),
                                       TColor(48, 100, 220)};
    for (int i = 0; i < 3; ++i)
        add_arrow(*axes, Vector3d::Zero(), length * Vector3d::Unit(i), radius,
                  rgb[static_cast<size_t>(i)]);
    scene.insert(axes);
    if (estimate.g_W.norm() < 1e-6) return;
    auto gravity = make_mesh("gravity", colors.gravity);
    add_arrow(*gravity, Vector3d::Zero(), 1.4 * length * estimate.g_W.normalized(), 1.2 * radius,
              colors.gravity);
    scene.insert(gravity);
}

/// 1, 2 or 5 times a power of ten, at least x.
double round_up(double x) {
    const double power = std::pow(10, std::floor(std::log10(x)));
    for (double factor : {1.0, 2.0, 5.0})
        if (factor * power >= x * (1 - 1e-9)) return factor * power;
    return 10 * power;
}

void add_grid(COpenGLScene& scene, const std::vector<Vector3d>& path,
              const std::vector<Vector3d>& nearby, const Sizes& sizes, const Palette& colors) {
    Eigen::AlignedBox3d box;
    for (const Vector3d& p : path) box.extend(p);
    const double z = box.min().z() - 0.04 * sizes.extent;
    for (const Vector3d& p : nearby) box.extend(p);
    const double cell = round_up(box.diagonal().head<2>().norm() / 16);
    const auto below = [cell](double x) {
        return static_cast<float>(cell * (std::floor(x / cell) - 1));
    };
    const auto above = [cell](double x) {
        return static_cast<float>(cell * (std::ceil(x / cell) + 1));
    };
    auto grid = mrpt::opengl::CGridPlaneXY::Create(below(box.min().x()), above(box.max().x()),
                                                   below(box.min().y()), above(box.max().y()),
                                                   static_cast<float>(z), static_cast<float>(cell));
    char name[48];
    std::snprintf(name, sizeof(name), "grid %g m", cell);
    grid->setName(name);
    grid->setColor_u8(colors.grid);
    scene.insert(grid);
}

/// Every finite position, and W's origin.
std::vector<Vector3d> all_paths(const std::vector<StateEstimate>& states,
                                const std::vector<NamedPath>& others) {
    std::vector<Vector3d> path = {Vector3d::Zero()};
    for (const StateEstimate& s : states) path.push_back(s.T_W_B.p);
    for (const NamedPath& other : others)
        for (const TimedPose& row : other.poses)
            if (row.T_W_B.p.allFinite()) path.push_back(row.T_W_B.p);
    return path;
}

}  // namespace

double path_extent(const Estimate& estimate, const std::vector<NamedPath>& others) {
    Eigen::AlignedBox3d box;
    for (const Vector3d& p : all_paths(finite_states(estimate), others)) box.extend(p);
    return std::max(box.diagonal().norm(), 0.1);
}

COpenGLScene::Ptr build_scene(const Estimate& estimate, const SceneOptions& options,
                              const std::vector<NamedPath>& others) {
    const Palette& colors = palette(options.dark);
    std::vector<StateEstimate> states = finite_states(estimate);
    const std::vector<Vector3d> path = all_paths(states, others);
    std::vector<Vector3d> landmarks;
    for (const LandmarkEstimate& landmark : estimate.landmarks)
        if (landmark.p_W.allFinite()) landmarks.push_back(landmark.p_W);
    const Sizes sizes{path_extent(estimate, others)};
    std::vector<StateEstimate> to_come;
    if (options.until) {
        const auto later = std::find_if(states.begin(), states.end(), [&](const StateEstimate& s) {
            return s.t > *options.until;
        });
        to_come.assign(later, states.end());
        states.erase(later, states.end());
    }

    auto scene = COpenGLScene::Create();
    scene->getViewport()->setCustomBackgroundColor(mrpt::img::TColorf(colors.background));
    auto& light = scene->getViewport()->lightParameters();
    light.ambient = {0.74f, 0.74f, 0.74f, 1.f};
    light.diffuse = {0.36f, 0.36f, 0.36f, 1.f};
    light.specular = {0.f, 0.f, 0.f, 1.f};

    add_grid(*scene, path, nearby_points(path, landmarks), sizes, colors);
    add_landmarks(*scene, estimate, options);
    add_axes_and_gravity(*scene, estimate, sizes, colors);
    for (size_t i = 0; i < others.size(); ++i) {
        const TColor& color = colors.others[i % colors.others.size()];
        auto mesh = make_mesh("path " + others[i].name, color);
        std::vector<Vector3d> points;
        for (const TimedPose& row : others[i].poses) points.push_back(row.T_W_B.p);
        add_path(*mesh, points, sizes.path_radius(), color);
        if (mesh->getTrianglesCount() > 0) scene->insert(mesh);
    }
    if (!to_come.empty()) {
        auto mesh = make_mesh("path to come", colors.grid);
        std::vector<Vector3d> points;
        for (const StateEstimate& state : to_come) points.push_back(state.T_W_B.p);
        add_path(*mesh, points, 0.35 * sizes.path_radius(), colors.grid);
        scene->insert(mesh);
    }
    add_estimate_path(*scene, states, options.name, sizes, colors);
    add_frusta(*scene, states, options, sizes, colors);
    add_ellipsoids(*scene, states, options, sizes, colors);  // last: they are transparent
    return scene;
}

void save_scene(const COpenGLScene& scene, const std::string& file) {
    bool saved = false;
    try {
        saved = scene.saveToFile(file);
    } catch (const std::exception&) {
    }
    if (!saved) throw InputError(file + ": cannot be written; check the folder and the free space");
}

COpenGLScene::Ptr load_scene(const std::string& file) {
    if (!is_file(file))
        throw InputError(file + ": no such file; give a results folder, a rawlog or a .3Dscene");
    auto scene = COpenGLScene::Create();
    bool loaded = false;
    try {
        loaded = scene->loadFromFile(file);
    } catch (const std::exception&) {
    }
    if (!loaded || !scene->getViewport())
        throw InputError(file + ": not a readable .3Dscene; was it written completely?");
    return scene;
}

}  // namespace vio
