#include "libvio/simulation/trajectory.h"

#include <cmath>

namespace vio {
namespace {

using Vector4d = Eigen::Vector4d;  // quaternion w x y z

// Vector part of conj(s) * d.
Eigen::Vector3d body_rate(const Vector4d& s, const Vector4d& d) {
    const Eigen::Vector3d sv = s.tail<3>(), dv = d.tail<3>();
    return s[0] * dv - d[0] * sv - sv.cross(dv);
}

// Rows x y z qw qx qy qz, the sign of the quaternion without jumps.
Eigen::MatrixXd as_rows(const std::vector<Waypoint>& poses) {
    Eigen::MatrixXd rows(poses.size(), 7);
    Vector4d previous = Vector4d::UnitX();
    for (Eigen::Index i = 0; i < rows.rows(); ++i) {
        const Eigen::Quaterniond q(poses[i].T_W_B.R);
        Vector4d wxyz(q.w(), q.x(), q.y(), q.z());
        if (wxyz.dot(previous) < 0) wxyz = -wxyz;
        rows.row(i) << poses[i].T_W_B.p.transpose(), wxyz.transpose();
        previous = wxyz;
    }
    return rows;
}

std::vector<double> times_of(const std::vector<Waypoint>& poses) {
    std::vector<double> times;
    for (const Waypoint& pose : poses) times.push_back(pose.t);
    return times;
}

}  // namespace

Motion moved_to(const Motion& body, const Pose& T_B_S) {
    const Eigen::Matrix3d& R = body.T_W_B.R;
    const Eigen::Vector3d &w = body.omega_B, arm_velocity = w.cross(T_B_S.p);
    Motion s;
    s.T_W_B = body.T_W_B * T_B_S;
    s.v_W = body.v_W + R * arm_velocity;
    s.a_W = body.a_W + R * (body.alpha_B.cross(T_B_S.p) + w.cross(arm_velocity));
    s.omega_B = T_B_S.R.transpose() * w;
    s.alpha_B = T_B_S.R.transpose() * body.alpha_B;
    return s;
}

double Trajectory::path_length() const {
    constexpr double kStep = 1e-3;
    const int steps = std::max(1, static_cast<int>(std::ceil((end() - begin()) / kStep)));
    double length = 0;
    Eigen::Vector3d from = at(begin()).T_W_B.p;
    for (int i = 1; i <= steps; ++i) {
        const Eigen::Vector3d to = at(begin() + (end() - begin()) * i / steps).T_W_B.p;
        length += (to - from).norm();
        from = to;
    }
    return length;
}

SplineTrajectory SplineTrajectory::through(const std::vector<Waypoint>& points, CurveEnds ends) {
    return SplineTrajectory(BSpline::interpolating(times_of(points), as_rows(points), ends));
}

SplineTrajectory SplineTrajectory::along(const std::vector<Waypoint>& recorded, double piece) {
    return SplineTrajectory(BSpline::fitted(times_of(recorded), as_rows(recorded), piece));
}

Motion SplineTrajectory::at(double t) const {
    const Eigen::VectorXd y = curve_.evaluate(t, 0), dy = curve_.evaluate(t, 1),
                          ddy = curve_.evaluate(t, 2);
    const Vector4d s = y.tail<4>(), ds = dy.tail<4>(), dds = ddy.tail<4>();
    const double n2 = s.squaredNorm();
    Motion m;
    m.T_W_B.R = Eigen::Quaterniond(s[0], s[1], s[2], s[3]).normalized().toRotationMatrix();
    m.T_W_B.p = y.head<3>();
    m.v_W = dy.head<3>();
    m.a_W = ddy.head<3>();
    m.omega_B = 2 * body_rate(s, ds) / n2;
    m.alpha_B = 2 * body_rate(s, dds) / n2 - m.omega_B * (2 * s.dot(ds) / n2);
    return m;
}

}  // namespace vio
