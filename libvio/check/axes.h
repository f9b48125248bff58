// Exchanged and negated axes: the 48 signed permutations of x, y and z.
#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

namespace vio {

/// All of them, the identity first; proper: the 24 rotations among them only.
std::vector<Eigen::Matrix3d> signed_permutations(bool proper);

/// "x = y, y = -x, z = z" for true = P measured.
std::string axes_text(const Eigen::Matrix3d& P);

}  // namespace vio
