// The arm experiments (paper, sections 7 and 8): estimates and their errors, without files between.
#pragma once

#include <cmath>
#include <memory>
#include <optional>
#include <string>

#include "libvio/batch/batch.h"
#include "libvio/evaluation/evaluate.h"
#include "libvio/recursive/iekf.h"
#include "libvio/simulation/scenario.h"
#include "tests/feed.h"

namespace vio::test {

/// After similarity alignment, as the paper's (26, 27).
struct ArmErrors {
    double rotation = 0, rotation_max = 0;  ///< [rad]
    double position = 0, position_max = 0;  ///< [m]
    std::optional<double> scale;            ///< [-]
    bool complete = true;                   ///< a pose for each image, none of them lost
};

class Arm {
 public:
    explicit Arm(const std::string& scenario_file, int seed = 0)
        : Arm(options(scenario_file, seed)) {}
    explicit Arm(const ScenarioOptions& options)
        : simulation_(std::make_shared<Simulation>(options)), rig_(simulation_->stated_rig()) {}
    /// The same data, estimated with another calibration.
    Arm(const Arm& other, const Rig& rig) : simulation_(other.simulation_), rig_(rig) {}

    const Rig& true_rig() const { return simulation_->rig(); }

    BatchResult batch(bool inertial, const std::optional<Estimate>& start = std::nullopt) const {
        BatchProblem problem;
        problem.rig = rig_;
        problem.frames = simulation_->tracks().frames;
        if (inertial) problem.imu = ImuSequence(simulation_->imu());
        return estimate_batch(problem, batch_options(), start);
    }

    Estimate recursive(int prefix_images) const {
        IekfOptions options;
        options.sigma_px = kSigma_px;
        options.prefix_images = prefix_images;
        Iekf filter(rig_, options, batch_options());
        feed(filter, simulation_->imu(), simulation_->tracks().frames);
        filter.finish();
        return filter.estimate();
    }

    ArmErrors errors(const Estimate& estimate) const {
        std::vector<TimedPose> poses, truth;
        ArmErrors errors;
        for (const StateEstimate& state : estimate.states) {
            poses.push_back({state.t, state.T_W_B});
            errors.complete = errors.complete && !state.lost;
        }
        for (const StateEstimate& state : simulation_->truth())
            truth.push_back({state.t, state.T_W_B});
        errors.complete = errors.complete && poses.size() == truth.size();
        EvaluationOptions options;
        options.alignment = AlignmentKind::kSim3;
        if (poses.size() < 3) {
            errors.rotation = errors.position = errors.rotation_max = errors.position_max = NAN;
            return errors;
        }
        const Evaluation e = evaluate(poses, truth, options);
        errors.rotation = e.rotation.mean;
        errors.rotation_max = e.rotation.max;
        errors.position = e.position.mean;
        errors.position_max = e.position.max;
        if (estimate.has_scale) errors.scale = e.scale_error;
        return errors;
    }

 private:
    static constexpr double kSigma_px = 2;  // the paper's, and the simulation's

    static ScenarioOptions options(const std::string& file, int seed) {
        ScenarioOptions options = ScenarioOptions::from_file(file);
        if (seed > 0) options.seed = seed;
        return options;
    }
    static BatchOptions batch_options() {
        BatchOptions options;
        options.sigma_px = kSigma_px;
        return options;
    }

    std::shared_ptr<const Simulation> simulation_;
    Rig rig_;
};

}  // namespace vio::test
