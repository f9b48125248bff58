#include "libvio/geometry/relative_pose.h"

namespace vio {

RelativePose relative_pose(const Pose& T_W_A, const Pose& T_W_B) {
    RelativePose result;
    result.T_A_B = T_W_A.inverse() * T_W_B;
    auto& J = result.J;
    J.setZero();
    J.block<3, 3>(0, 0) = -result.T_A_B.R.transpose();
    J.block<3, 3>(0, 6).setIdentity();
    J.block<3, 3>(3, 0) = so3::skew(result.T_A_B.p);
    J.block<3, 3>(3, 3) = -T_W_A.R.transpose();
    J.block<3, 3>(3, 9) = T_W_A.R.transpose();
    return result;
}

}  // namespace vio
