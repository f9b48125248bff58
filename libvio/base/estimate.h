// What both estimators give back, and what writers, evaluation and pictures take.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "libvio/base/types.h"
#include "libvio/geometry/pose.h"

namespace vio {

/// Order of the 15 error components of a StateEstimate: rotation (right perturbation, in B),
/// position, velocity (both in W), gyro bias, accelerometer bias (both in I).
enum StateIndex : int {
    kRotation = 0,
    kPosition = 3,
    kVelocity = 6,
    kGyroBias = 9,
    kAccelBias = 12
};

/// Motion at the time of one image.
struct StateEstimate {
    TimeNs t = 0;
    Pose T_W_B;
    Eigen::Vector3d v_W = Eigen::Vector3d::Zero();         ///< velocity of B's origin [m/s]
    Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();   ///< [rad/s]
    Eigen::Vector3d accel_bias = Eigen::Vector3d::Zero();  ///< [m/s^2]
    Matrix15d covariance = Matrix15d::Zero();              ///< in StateIndex order
    bool lost = false;  ///< inside an interval in which the estimator had lost track
    int features = 0;   ///< observations used at this image
};

/// A point of the scene in W, with its covariance.
struct LandmarkEstimate {
    FeatureId id = -1;
    Eigen::Vector3d p_W = Eigen::Vector3d::Zero();         ///< [m]
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< [m^2]
    int observations = 0;
    /// Mean colour (red, green, blue) at its places in the images, where those are at hand.
    std::optional<std::array<std::uint8_t, 3>> rgb = std::nullopt;
};

/// Motion from one key-frame to the next, from the joint distribution of both poses: more certain
/// than either of them.
struct RelativeMotion {
    TimeNs from = 0, to = 0;
    Pose T_A_B;  ///< body frame at `to` in the body frame at `from`
    /// (rotation, translation) in the tangent order of Pose; zero: not known.
    Matrix6d covariance = Matrix6d::Zero();
};

/// What an image tells the recursive estimator that its state did not expect. Of points whose
/// tracks were used; normalised by the covariance that the state claims (a chi-square variable with
/// dof degrees of freedom if it is right, but for the gate).
struct ImageInnovations {
    TimeNs t = 0;
    int landmarks = 0, landmarks_rejected = 0;    ///< points of the state in sight; failed the gate
    int new_points = 0, new_points_rejected = 0;  ///< points used from their tracks; failed
    double rms_px = 0;                            ///< of one coordinate, of those that passed
    double normalised = 0;                        ///< r^T S^-1 r of all that passed
    int dof = 0;
    double readings_normalised = 0;  ///< of the inertial readings since the last image, where they
    int readings_dof = 0;            ///< are measurements (motion model smooth)
};

/// Trajectory, structure and parameters in a world frame W whose z axis is up when inertial data
/// are used; the first pose has zero position and zero yaw.
struct Estimate {
    std::vector<StateEstimate> states;        ///< in order of time, one per image
    std::vector<LandmarkEstimate> landmarks;  ///< in order of id
    /// From key-frame to key-frame, in order of time: images that follow the motion, by the overlap
    /// of their features.
    std::vector<RelativeMotion> keyframe_motions;
    std::vector<ImageInnovations> innovations;  ///< in order of time; none of the batch estimator
    Eigen::Vector3d g_W = Eigen::Vector3d::Zero();  ///< [m/s^2]
    Eigen::Matrix3d gravity_covariance = Eigen::Matrix3d::Zero();
    bool has_scale = true;  ///< false for image-only: global scale is arbitrary
};

}  // namespace vio
