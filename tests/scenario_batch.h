// Batch problems made from scenario files.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>

#include "libvio/evaluation/metrics.h"
#include "libvio/simulation/scenario.h"
#include "tests/simulated_batch.h"

namespace vio::test {

struct ScenarioRun {
    BatchProblem problem;
    Estimate truth;  ///< in the scenario's frame, with landmarks
    double sigma_px = 1;
};

/// The first `images` of a scenario with feature tracks (0: all).
inline ScenarioRun run_scenario(ScenarioOptions options, int images = 0) {
    options.tracks = true;
    options.render = false;
    if (images > 0) options.image_count = images;
    const Simulation simulation(options);
    ScenarioRun run;
    run.sigma_px = options.track_model.noise_px;
    run.problem.rig = simulation.rig();
    run.problem.frames = simulation.tracks().frames;
    run.problem.imu = ImuSequence(simulation.imu());
    run.truth.g_W = simulation.g_W();
    run.truth.states = simulation.truth();
    for (const auto& [id, point] : simulation.tracks().points_W) {
        LandmarkEstimate landmark;
        landmark.id = id;
        landmark.p_W = point;
        run.truth.landmarks.push_back(landmark);
    }
    return run;
}

struct Errors {
    double rotation = 0, position = 0, worst_position = 0, scale = 0;  // rad, m, m, share
};

/// After a similarity alignment, as the paper's metrics. The estimate may lack images.
inline Errors errors_of(const Estimate& estimate, const Estimate& truth) {
    std::vector<TimedPose> a, b;
    auto s = truth.states.begin();
    for (const StateEstimate& found : estimate.states) {
        while (s->t != found.t) ++s;
        a.push_back({found.t, found.T_W_B});
        b.push_back({s->t, s->T_W_B});
    }
    Eigen::Matrix3Xd from(3, a.size()), to(3, b.size());
    for (size_t i = 0; i < a.size(); ++i) {
        from.col(static_cast<Eigen::Index>(i)) = a[i].T_W_B.p;
        to.col(static_cast<Eigen::Index>(i)) = b[i].T_W_B.p;
    }
    const Eigen::Matrix4d S = Eigen::umeyama(from, to, true);
    const double scale = std::cbrt(S.topLeftCorner<3, 3>().determinant());
    const Eigen::Matrix3d R = S.topLeftCorner<3, 3>() / scale;
    Errors errors;
    errors.scale = 1 / scale - 1;
    for (size_t i = 0; i < a.size(); ++i) {
        const Eigen::Vector3d p = S.topLeftCorner<3, 3>() * a[i].T_W_B.p + S.topRightCorner<3, 1>();
        const double d = (p - b[i].T_W_B.p).norm();
        errors.position += d / static_cast<double>(a.size());
        errors.worst_position = std::max(errors.worst_position, d);
        errors.rotation += so3::log(R * a[i].T_W_B.R * b[i].T_W_B.R.transpose()).norm() /
                           static_cast<double>(a.size());
    }
    return errors;
}

/// The paper's cost function: fixed variances, constant biases, free gravity.
inline BatchOptions paper_options(double variance, double sigma_px) {
    BatchOptions options;
    options.sigma_px = sigma_px;
    options.weighting = "fixed";
    options.fixed_variance = variance;
    options.bias = "constant";
    options.gravity = "free";
    options.loss = "none";
    options.outlier_sigmas = 0;
    options.start = "blind";
    return options;
}

}  // namespace vio::test
