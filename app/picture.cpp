#include "app/picture.h"

#include <filesystem>
#include <vector>

#include "gui_offscreen/scene.h"
#include "gui_offscreen/snapshot.h"
#include "libvio/base/errors.h"
#include "libvio/evaluation/evaluate.h"
#include "libvio/io/trajectory_io.h"

namespace vio::app {
namespace {

// The true path in the estimate's world.
NamedPath aligned_truth(const Estimate& estimate, const NamedPath& truth) {
    const std::vector<TimedPose> poses = trajectory(estimate);
    EvaluationOptions options;
    options.alignment = estimate.has_scale ? AlignmentKind::kSE3 : AlignmentKind::kSim3;
    options.estimate_has_scale = estimate.has_scale;
    options.truth_name = truth.name;
    const Similarity S_G_E = evaluate(poses, truth.poses, options).alignment.S_G_E;
    std::vector<TimedPose> shown;
    for (const TimedPose& row : vio::apply(S_G_E.inverse(), truth.poses))
        if (row.t >= poses.front().t && row.t <= poses.back().t) shown.push_back(row);
    return {"truth", shown};
}

// Half of the camera's field of view, as tangents.
Eigen::Vector2d half_view(const Camera& camera) {
    const Eigen::Vector2d centre(0.5 * (camera.width() - 1), 0.5 * (camera.height() - 1));
    const auto right = camera.ray({camera.width() - 1, centre.y()});
    const auto bottom = camera.ray({centre.x(), camera.height() - 1});
    const auto tangent = [](const std::optional<Ray>& ray, int axis, double otherwise) {
        if (!ray || ray->direction.z() < 0.2) return otherwise;
        return ray->direction[axis] / ray->direction.z();
    };
    const SceneOptions defaults;
    return {tangent(right, 0, defaults.half_view.x()), tangent(bottom, 1, defaults.half_view.y())};
}

}  // namespace

Drawing drawing_of(const Estimate& estimate, const Rig& rig, const NamedPath& truth) {
    Drawing drawing;
    drawing.options.T_B_C = rig.T_B_C;
    if (rig.camera) drawing.options.half_view = half_view(*rig.camera);
    try {
        if (!truth.poses.empty()) drawing.others.push_back(aligned_truth(estimate, truth));
    } catch (const InputError& error) {
        drawing.problem = std::string("truth not drawn: ") + error.what();
    }
    return drawing;
}

std::string write_picture(const Estimate& estimate, const Rig& rig, const NamedPath& truth,
                          const std::string& folder) {
    const Drawing drawing = drawing_of(estimate, rig, truth);
    // A picture of an earlier run must not stand beside these results.
    std::filesystem::remove(folder + "/snapshot.png");
    const auto scene = build_scene(estimate, drawing.options, drawing.others);
    save_scene(*scene, folder + "/scene.3Dscene");
    const Snapshot snapshot = render_snapshot(scene);
    if (!snapshot.problem.empty()) return snapshot.problem;
    save_image(snapshot.image, folder + "/snapshot.png");
    return drawing.problem;
}

}  // namespace vio::app
