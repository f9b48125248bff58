#include "libvio/geometry/alignment.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace vio {
namespace {

constexpr double kLineWidthRatio = 1e-4;

/// Standard deviations of the points along their principal axes, largest first [m].
Eigen::Vector3d principal_spread(const Eigen::Matrix3Xd& points) {
    const Eigen::Matrix3Xd centred = points.colwise() - points.rowwise().mean();
    const Eigen::Matrix3d covariance =
        centred * centred.transpose() / static_cast<double>(points.cols());
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(covariance, Eigen::EigenvaluesOnly);
    return eigen.eigenvalues().cwiseMax(0).cwiseSqrt().reverse();
}

/// What the points of one set say about a rotation and scale of them.
AlignmentStatus determinacy(const Eigen::Matrix3Xd& points) {
    const Eigen::Vector3d spread = principal_spread(points);
    const double rounding = 1e-12 * (1 + points.cwiseAbs().maxCoeff());
    if (spread[0] <= rounding) return AlignmentStatus::kStationary;
    if (spread[1] <= std::max(rounding, kLineWidthRatio * spread[0]))
        return AlignmentStatus::kCollinear;
    return AlignmentStatus::kDetermined;
}

AlignmentStatus determinacy(const Eigen::Matrix3Xd& p_E, const Eigen::Matrix3Xd& p_G,
                            AlignmentKind kind) {
    if (kind == AlignmentKind::kNone) return AlignmentStatus::kDetermined;
    if (p_E.cols() < 2) return AlignmentStatus::kTooFewPoints;
    if (kind == AlignmentKind::kYawPosition) {
        Eigen::Matrix3Xd flat_E = p_E, flat_G = p_G;
        flat_E.row(2).setZero();
        flat_G.row(2).setZero();
        const bool stationary = determinacy(flat_E) == AlignmentStatus::kStationary ||
                                determinacy(flat_G) == AlignmentStatus::kStationary;
        return stationary ? AlignmentStatus::kStationary : AlignmentStatus::kDetermined;
    }
    const AlignmentStatus of_E = determinacy(p_E), of_G = determinacy(p_G);
    for (AlignmentStatus status : {AlignmentStatus::kStationary, AlignmentStatus::kCollinear})
        if (of_E == status || of_G == status) return status;
    return AlignmentStatus::kDetermined;
}

Eigen::Matrix3d yaw_rotation(double yaw) {
    return Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
}

}  // namespace

std::string to_string(AlignmentKind kind) {
    switch (kind) {
        case AlignmentKind::kNone:
            return "none";
        case AlignmentKind::kYawPosition:
            return "yaw+position";
        case AlignmentKind::kSE3:
            return "SE(3)";
        case AlignmentKind::kSim3:
            return "Sim(3)";
    }
    return "";
}

Alignment align(const Eigen::Matrix3Xd& p_E, const Eigen::Matrix3Xd& p_G, AlignmentKind kind) {
    Alignment result;
    result.kind = kind;
    result.status = determinacy(p_E, p_G, kind);
    if (kind == AlignmentKind::kNone || p_E.cols() == 0) return result;

    const Eigen::Vector3d mean_E = p_E.rowwise().mean(), mean_G = p_G.rowwise().mean();
    Similarity& S = result.S_G_E;
    if (result.status == AlignmentStatus::kDetermined ||
        result.status == AlignmentStatus::kCollinear) {
        if (kind == AlignmentKind::kYawPosition) {
            const Eigen::Matrix3d H =
                (p_G.colwise() - mean_G) * (p_E.colwise() - mean_E).transpose();
            S.R = yaw_rotation(std::atan2(H(1, 0) - H(0, 1), H(0, 0) + H(1, 1)));
        } else {
            const Eigen::Matrix4d T =
                Eigen::umeyama(p_E, p_G, /*with_scaling=*/kind == AlignmentKind::kSim3);
            S.s =
                kind == AlignmentKind::kSim3 ? std::cbrt(T.topLeftCorner<3, 3>().determinant()) : 1;
            S.R = so3::normalized(T.topLeftCorner<3, 3>() / S.s);
        }
    }
    S.p = mean_G - S.s * (S.R * mean_E);
    return result;
}

Similarity align_yaw_position(const Pose& T_E_B, const Pose& T_G_B) {
    // Maximises the trace of (yaw R_E_B)^T R_G_B.
    const Eigen::Matrix3d H = T_G_B.R * T_E_B.R.transpose();
    Similarity S;
    S.R = yaw_rotation(std::atan2(H(1, 0) - H(0, 1), H(0, 0) + H(1, 1)));
    S.p = T_G_B.p - S.R * T_E_B.p;
    return S;
}

}  // namespace vio
