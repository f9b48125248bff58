#include "libvio/geometry/so3.h"

#include <Eigen/Dense>
#include <cmath>

namespace vio::so3 {
namespace {
// Below this angle the Taylor series are exact to double precision.
constexpr double kSmallAngle = 1e-4;
}  // namespace

Eigen::Matrix3d skew(const Eigen::Vector3d& a) {
    Eigen::Matrix3d m;
    m << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
    return m;
}

Eigen::Matrix3d exp(const Eigen::Vector3d& rotation_vector) {
    const double angle2 = rotation_vector.squaredNorm();
    const double angle = std::sqrt(angle2);
    double a = 1 - angle2 / 6, b = 0.5 - angle2 / 24;
    if (angle > kSmallAngle) {
        const double half_sine = std::sin(0.5 * angle);
        a = std::sin(angle) / angle;
        b = 2 * half_sine * half_sine / angle2;
    }
    const Eigen::Matrix3d S = skew(rotation_vector);
    return Eigen::Matrix3d::Identity() + a * S + b * S * S;
}

Eigen::Vector3d log(const Eigen::Matrix3d& R) {
    // By way of the quaternion, whose conversion picks the well-conditioned branch near pi.
    Eigen::Quaterniond q(R);
    if (q.w() < 0) q.coeffs() *= -1;
    const double sine = q.vec().norm();
    if (sine < kSmallAngle) return q.vec() * (2 / q.w()) * (1 - sine * sine / (3 * q.w() * q.w()));
    return q.vec() * (2 * std::atan2(sine, q.w()) / sine);
}

Eigen::Matrix3d right_jacobian(const Eigen::Vector3d& rotation_vector) {
    const double angle2 = rotation_vector.squaredNorm();
    const double angle = std::sqrt(angle2);
    double a = 0.5 - angle2 / 24, b = 1.0 / 6 - angle2 / 120;
    if (angle > kSmallAngle) {
        const double half_sine = std::sin(0.5 * angle);
        a = 2 * half_sine * half_sine / angle2;
        // The difference angle - sin(angle) cancels: use its series up to moderate angles.
        b = angle > 0.1 ? (angle - std::sin(angle)) / (angle2 * angle)
                        : 1.0 / 6 - angle2 / 120 + angle2 * angle2 / 5040;
    }
    const Eigen::Matrix3d S = skew(rotation_vector);
    return Eigen::Matrix3d::Identity() - a * S + b * S * S;
}

Eigen::Matrix3d right_jacobian_inverse(const Eigen::Vector3d& rotation_vector) {
    const double angle2 = rotation_vector.squaredNorm();
    const double angle = std::sqrt(angle2);
    double b = 1.0 / 12 + angle2 / 720 + angle2 * angle2 / 30240;
    if (angle > 0.1) b = 1 / angle2 - 0.5 / (angle * std::tan(0.5 * angle));
    const Eigen::Matrix3d S = skew(rotation_vector);
    return Eigen::Matrix3d::Identity() + 0.5 * S + b * S * S;
}

Eigen::Matrix3d normalized(const Eigen::Matrix3d& R) {
    return 0.5 * R * (3 * Eigen::Matrix3d::Identity() - R.transpose() * R);
}

Eigen::Matrix3d rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
    return Eigen::Quaterniond::FromTwoVectors(from, to).toRotationMatrix();
}

}  // namespace vio::so3
