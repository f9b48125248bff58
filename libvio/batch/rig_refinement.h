// Parts of the rig as further unknowns of a minimisation: where they stand, what was known of them
// beforehand.
#pragma once

#include <string>
#include <vector>

#include "libvio/batch/objective.h"

namespace vio::batch {

/// Name and unit of an unknown of the camera's mount: T_I_C in the order of a pose's errors, then
/// its clock.
struct MountUnknown {
    const char *name, *unit;
};
inline constexpr int kExtrinsicUnknowns = 6;
inline constexpr MountUnknown kMountUnknowns[kExtrinsicUnknowns + 1] = {
    {"rotation x", "rad"}, {"rotation y", "rad"}, {"rotation z", "rad"}, {"position x", "m"},
    {"position y", "m"},   {"position z", "m"},   {"time offset", "s"}};

/// The rig of a model while it is being estimated with everything else. What it was made with is
/// what is stated of it.
class RigRefinement {
 public:
    /// sigmas: of what is stated, in the order of RigUnknowns [rad, m, s, unit of the intrinsic];
    /// infinite: nothing is known. problem and model must outlive this.
    RigRefinement(const BatchProblem& problem, Model& model, const RigUnknowns& unknowns,
                  const Eigen::VectorXd& sigmas);

    const Rig& rig() const { return rig_; }
    /// Names and units of the unknowns.
    std::vector<std::string> names() const;
    std::vector<std::string> units() const;
    const Eigen::VectorXd& sigmas() const { return sigmas_; }
    /// Whether one of them is known exactly: of the extrinsics, rotation or position may be.
    bool held(Eigen::Index k) const;
    /// Where they are, less what was stated; of the rotation: in its tangent space.
    Eigen::VectorXd change() const;

    /// What the statement adds to the error function.
    double cost() const;
    /// Sets the rig's part of the normal equations that the objective has linearised at the state.
    void linearize(const Objective& objective, const State& state,
                   NormalEquations& equations) const;
    /// Moves the rig, with model and objective, by a step. False, and nothing is moved: no such rig
    /// (not a camera, or images come to lie outside the readings).
    bool move(const Eigen::VectorXd& step, Objective& objective);
    /// Takes the last move() back.
    void take_back(Objective& objective);

 private:
    void set(const Rig& rig, Objective& objective);

    const BatchProblem& problem_;
    Model& model_;
    RigUnknowns unknowns_;
    Eigen::VectorXd sigmas_, information_;
    Rig stated_, rig_, before_;
};

/// The unknowns that the options leave open, and the standard deviations of what is stated of them.
RigUnknowns rig_unknowns(const Rig& rig, const BatchOptions& options);
Eigen::VectorXd rig_sigmas(const Rig& rig, const BatchOptions& options);

}  // namespace vio::batch
