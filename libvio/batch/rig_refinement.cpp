#include "libvio/batch/rig_refinement.h"

#include <algorithm>
#include <cmath>

#include "libvio/base/angles.h"
#include "libvio/base/errors.h"
#include "libvio/camera/intrinsics.h"
#include "libvio/geometry/so3.h"

namespace vio::batch {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double kKnown = 1e-9;  // [rad], [m], ...: sigma of what is not to move

// Standard deviations of a camera's first intrinsics: each alone displaces no pixel of the image by
// more than sigma_px.
VectorXd intrinsic_sigmas(const Camera& camera, int count, double sigma_px) {
    constexpr int kGrid = 12;       // pixels a side
    constexpr double kRange = 100;  // [m]: mirrors without a single viewpoint see far points alike
    const IntrinsicJacobian jacobian(camera, count);
    VectorXd largest = VectorXd::Zero(count);
    for (int row = 0; row <= kGrid; ++row)
        for (int col = 0; col <= kGrid; ++col) {
            const auto ray = camera.ray(
                {(camera.width() - 1.0) * col / kGrid, (camera.height() - 1.0) * row / kGrid});
            if (!ray) continue;
            const Eigen::Matrix2Xd J = jacobian(ray->origin + kRange * ray->direction);
            largest = largest.cwiseMax(J.colwise().norm().transpose());
        }
    return sigma_px * largest.cwiseMax(1e-6).cwiseInverse();
}

}  // namespace

RigRefinement::RigRefinement(const BatchProblem& problem, Model& model, const RigUnknowns& unknowns,
                             const VectorXd& sigmas)
    : problem_(problem),
      model_(model),
      unknowns_(unknowns),
      sigmas_(sigmas),
      information_(sigmas.cwiseAbs2().cwiseInverse()),
      stated_(problem.rig),
      rig_(problem.rig),
      before_(problem.rig) {}

std::vector<std::string> RigRefinement::names() const {
    std::vector<std::string> names;
    if (unknowns_.extrinsics)
        for (int k = 0; k < kExtrinsicUnknowns; ++k) names.emplace_back(kMountUnknowns[k].name);
    if (unknowns_.time_offset) names.emplace_back(kMountUnknowns[kExtrinsicUnknowns].name);
    if (unknowns_.intrinsics > 0)
        for (const std::string& name : intrinsic_names(*rig_.camera, unknowns_.intrinsics))
            names.push_back(name);
    return names;
}

std::vector<std::string> RigRefinement::units() const {
    std::vector<std::string> units;
    if (unknowns_.extrinsics)
        for (int k = 0; k < kExtrinsicUnknowns; ++k) units.emplace_back(kMountUnknowns[k].unit);
    if (unknowns_.time_offset) units.emplace_back(kMountUnknowns[kExtrinsicUnknowns].unit);
    const std::string model = rig_.camera->model_name();
    const std::string focal = model == "fisheye"            ? "px/rad"
                              : model == "parabolic_mirror" ? "px/m"
                                                            : "px";
    for (int k = 0; k < unknowns_.intrinsics; ++k)
        units.emplace_back(k < 2 ? focal : k < 4 ? "px" : "");
    return units;
}

bool RigRefinement::held(Index k) const {
    return sigmas_(k) <= kKnown;
}

VectorXd RigRefinement::change() const {
    VectorXd change(unknowns_.count());
    if (unknowns_.extrinsics) change.head<6>() = rig_.T_I_C().boxminus(stated_.T_I_C());
    if (unknowns_.time_offset)
        change(unknowns_.extrinsics ? 6 : 0) = rig_.time_offset - stated_.time_offset;
    if (const int n = unknowns_.intrinsics; n > 0)
        change.tail(n) = intrinsics(*rig_.camera, n) - intrinsics(*stated_.camera, n);
    return change;
}

double RigRefinement::cost() const {
    return change().cwiseAbs2().dot(information_);
}

void RigRefinement::linearize(const Objective& objective, const State& state,
                              NormalEquations& equations) const {
    equations.rig = objective.linearize_rig(state, unknowns_, equations);
    const VectorXd from_stated = change();
    MatrixXd J = MatrixXd::Identity(from_stated.size(), from_stated.size());
    if (unknowns_.extrinsics)
        J.topLeftCorner<3, 3>() = so3::right_jacobian_inverse(from_stated.head<3>());
    const MatrixXd weighted = information_.asDiagonal() * J;
    equations.rig->H.noalias() += J.transpose() * weighted;
    equations.rig->gradient.noalias() += weighted.transpose() * from_stated;
}

void RigRefinement::set(const Rig& rig, Objective& objective) {
    if (unknowns_.time_offset) {
        set_rig(model_, problem_, rig);
        objective.readings_changed();
    } else {
        set_camera(model_, rig);
    }
}

bool RigRefinement::move(const VectorXd& step, Objective& objective) {
    before_ = rig_;
    Rig next = rig_;
    try {
        if (unknowns_.extrinsics)
            next.T_B_C = rig_.T_B_I * rig_.T_I_C().boxplus(Vector6d(step.head<6>()));
        if (unknowns_.time_offset) next.time_offset += step(unknowns_.extrinsics ? 6 : 0);
        if (const int n = unknowns_.intrinsics; n > 0)
            next.camera = with_intrinsics(*rig_.camera, intrinsics(*rig_.camera, n) + step.tail(n));
        set(next, objective);
    } catch (const InputError&) {
        set(rig_, objective);
        return false;
    }
    rig_ = next;
    return true;
}

void RigRefinement::take_back(Objective& objective) {
    rig_ = before_;
    set(rig_, objective);
}

RigUnknowns rig_unknowns(const Rig& rig, const BatchOptions& options) {
    RigUnknowns unknowns;
    unknowns.extrinsics =
        options.extrinsics_rotation_sigma > 0 || options.extrinsics_position_sigma > 0;
    unknowns.time_offset = options.time_offset_sigma > 0;
    // A third radial coefficient that is stated to be zero is hardly ever known to be.
    constexpr int kRadialAndTangential = 5;
    if (options.intrinsics_sigma > 0 && rig.camera)
        unknowns.intrinsics =
            4 + (rig.camera->model_name() == "perspective"
                     ? std::max(kRadialAndTangential, distortion_count(*rig.camera))
                     : distortion_count(*rig.camera));
    return unknowns;
}

VectorXd rig_sigmas(const Rig& rig, const BatchOptions& options) {
    const RigUnknowns unknowns = rig_unknowns(rig, options);
    VectorXd sigmas(unknowns.count());
    if (unknowns.extrinsics) {
        sigmas.head<3>().setConstant(kDegree * options.extrinsics_rotation_sigma);
        sigmas.segment<3>(3).setConstant(options.extrinsics_position_sigma);
    }
    if (unknowns.time_offset) sigmas(unknowns.extrinsics ? 6 : 0) = options.time_offset_sigma;
    if (const int n = unknowns.intrinsics; n > 0)
        sigmas.tail(n) = intrinsic_sigmas(*rig.camera, n, options.intrinsics_sigma);
    return sigmas.cwiseMax(kKnown);
}

}  // namespace vio::batch
