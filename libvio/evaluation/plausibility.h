// What associated poses tell of mistakes in how they were given: units and frames.
#pragma once

#include <Eigen/Dense>
#include <optional>
#include <string>
#include <vector>

#include "libvio/evaluation/association.h"

namespace vio {

/// One line if truth and estimate have the same shape but differ by the factor of a unit (100,
/// 1000, 1/1000). Positions [m]; columns correspond.
std::optional<std::string> other_unit(const Eigen::Matrix3Xd& p_E, const Eigen::Matrix3Xd& p_G);

/// One line if the attitudes of aligned poses differ by a constant turn, which it gives as that of
/// what the truth tracks, or by much although the positions agree. R_B_T: what was taken for it.
std::optional<std::string> other_attitude(const std::vector<PosePair>& aligned,
                                          const Eigen::Matrix3d& R_B_T);

}  // namespace vio
