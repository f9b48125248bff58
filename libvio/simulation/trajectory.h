// Twice differentiable motion of the vehicle, with analytic derivatives.
#pragma once

#include <memory>
#include <vector>

#include "libvio/geometry/pose.h"
#include "libvio/simulation/bspline.h"

namespace vio {

/// Motion of the body B at one time.
struct Motion {
    Pose T_W_B;
    Eigen::Vector3d v_W = Eigen::Vector3d::Zero();      ///< velocity of B's origin [m/s]
    Eigen::Vector3d a_W = Eigen::Vector3d::Zero();      ///< acceleration of B's origin [m/s^2]
    Eigen::Vector3d omega_B = Eigen::Vector3d::Zero();  ///< angular velocity [rad/s]
    Eigen::Vector3d alpha_B = Eigen::Vector3d::Zero();  ///< angular acceleration [rad/s^2]
};

/// Motion of a frame S that is fixed to B, by the rigid body's kinematics (lever arm included).
Motion moved_to(const Motion& body, const Pose& T_B_S);

/// The body's motion in W as a function of time.
class Trajectory {
 public:
    virtual ~Trajectory() = default;
    /// Motion at t [s].
    virtual Motion at(double t) const = 0;
    virtual double begin() const = 0;  ///< [s]
    virtual double end() const = 0;    ///< [s]

    /// Length of the path of B's origin over [begin, end], by summing chords of 1 ms [m].
    double path_length() const;
};

/// A pose and when it is passed.
struct Waypoint {
    double t = 0;  ///< [s]
    Pose T_W_B;
};

/// Position and attitude as one quintic spline in R^7; the quaternion is normalised where it is
/// evaluated. With its four components s(t) before normalisation and s' the conjugate of s:
///   omega = 2 vec(s' ds) / |s|^2,   alpha = 2 vec(s' dds) / |s|^2 - omega (2 s . ds) / |s|^2.
/// Fourth derivatives are continuous, so readings of an ideal IMU are smooth.
/// Attitudes of successive poses must differ by less than 180 degrees.
class SplineTrajectory final : public Trajectory {
 public:
    /// Through control points. kAtRest: starts from rest and comes to rest.
    static SplineTrajectory through(const std::vector<Waypoint>& points, CurveEnds ends);

    /// Along a recorded path (TUM or EuRoC ground truth): least-squares fit with pieces of
    /// `piece` seconds. Pieces as long as the recording's sampling interval follow it closely;
    /// longer ones keep its noise out of the accelerations.
    static SplineTrajectory along(const std::vector<Waypoint>& recorded, double piece);

    Motion at(double t) const override;
    double begin() const override { return curve_.begin(); }
    double end() const override { return curve_.end(); }

 private:
    explicit SplineTrajectory(BSpline curve) : curve_(std::move(curve)) {}
    BSpline curve_;
};

}  // namespace vio
