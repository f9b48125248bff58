// Motion between two poses.
#pragma once

#include "libvio/geometry/pose.h"

namespace vio {

/// B seen from A, with its derivative.
struct RelativePose {
    Pose T_A_B;                      ///< T_W_A^-1 T_W_B
    Eigen::Matrix<double, 6, 12> J;  ///< d T_A_B / d (T_W_A, T_W_B), each in Pose's tangent order
};

/// With right perturbations a, b of the rotations and shifts dA, dB of the positions, to first
/// order: theta = b - R_A_B^T a,  d = skew(p_A_B) a + R_W_A^T (dB - dA).
RelativePose relative_pose(const Pose& T_W_A, const Pose& T_W_B);

}  // namespace vio
