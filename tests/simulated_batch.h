// Batch problems made from a simulated run, and its truth in the batch estimator's world frame.
#pragma once

#include "libvio/batch/batch.h"
#include "tests/simulated_run.h"

namespace vio::test {

inline BatchProblem batch_problem(const SimulatedRun& run, bool inertial = true) {
    BatchProblem problem;
    problem.rig = run.rig;
    problem.frames = run.frames;
    if (inertial) problem.imu = ImuSequence(run.readings);
    return problem;
}

/// A truth in the frame in which `first` is its first pose: positions relative to it, heading such
/// that the two first attitudes differ by a tilt only (z stays up).
inline Estimate seen_from(Estimate truth, const Pose& first) {
    const Pose T0 = truth.states.front().T_W_B;
    Eigen::Matrix3d Z = Eigen::Matrix3d::Identity();
    for (int i = 0; i < 5; ++i) {
        const Eigen::Vector3d difference = so3::log(first.R * (Z * T0.R).transpose());
        Z = so3::exp({0, 0, difference.z()}) * Z;
    }
    const Pose T_Wp_W{Z, first.p - Z * T0.p};
    for (StateEstimate& state : truth.states) {
        state.T_W_B = T_Wp_W * state.T_W_B;
        state.v_W = Z * state.v_W;
    }
    for (LandmarkEstimate& landmark : truth.landmarks) landmark.p_W = T_Wp_W * landmark.p_W;
    return truth;
}

inline Estimate truth_of(const SimulatedRun& run) {
    Estimate truth;
    truth.g_W = {0, 0, -9.81};
    truth.states = run.truth;
    for (size_t id = 0; id < run.point_of_feature.size(); ++id) {
        LandmarkEstimate landmark;
        landmark.id = static_cast<FeatureId>(id);
        landmark.p_W = run.points[run.point_of_feature[id]];
        truth.landmarks.push_back(landmark);
    }
    return truth;
}

inline Estimate truth_from(const SimulatedRun& run, const Pose& first) {
    return seen_from(truth_of(run), first);
}

/// Error of a state in StateIndex order.
inline Eigen::Matrix<double, 15, 1> state_error(const StateEstimate& estimate,
                                                const StateEstimate& truth) {
    Eigen::Matrix<double, 15, 1> e;
    e << estimate.T_W_B.boxminus(truth.T_W_B), estimate.v_W - truth.v_W,
        estimate.gyro_bias - truth.gyro_bias, estimate.accel_bias - truth.accel_bias;
    return e;
}

/// NEES of `size` values of a state from `first` on (StateIndex).
inline double state_nees(const StateEstimate& estimate, const StateEstimate& truth, int first,
                         int size) {
    const Eigen::VectorXd e = state_error(estimate, truth).segment(first, size);
    return e.dot(estimate.covariance.block(first, first, size, size).inverse() * e);
}

/// Mean NEES of landmarks that many images see, over estimates of runs.
class LandmarkNees {
 public:
    /// truth: truth_from() the estimate's first pose.
    void add(const Estimate& estimate, const Estimate& truth) {
        for (const LandmarkEstimate& landmark : estimate.landmarks)
            if (landmark.observations > 20) {
                const Eigen::Vector3d d =
                    landmark.p_W - truth.landmarks[static_cast<size_t>(landmark.id)].p_W;
                sum_ += d.dot(landmark.covariance.inverse() * d);
                ++count_;
            }
    }
    double mean() const { return sum_ / count_; }

 private:
    double sum_ = 0;
    int count_ = 0;
};

}  // namespace vio::test
