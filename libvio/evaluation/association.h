// Which truth belongs to which estimate.
#pragma once

#include <string>
#include <vector>

#include "libvio/base/types.h"
#include "libvio/geometry/pose.h"

namespace vio {

/// An estimated pose and the truth at the same time.
struct PosePair {
    int estimate_idx = 0;  ///< row of the estimated trajectory
    TimeNs t = 0;          ///< of the truth
    Pose estimate;         ///< T_E_B
    Pose truth;            ///< T_G_B
};

/// Pose between two rows, u in [0, 1]: constant velocity, constant angular velocity.
Pose interpolate(const Pose& T_W_B0, const Pose& T_W_B1, double u);

/// Throws InputError (`name`, row, time, remedy) unless the trajectory has rows, its stamps
/// increase strictly, every number is finite and every rotation is one. Rows count from 1.
void check_trajectory(const std::vector<TimedPose>& trajectory, const std::string& name);

/// Pairs every estimated pose with the truth interpolated at t + time_offset. A pose without truth
/// at exactly its time is left out unless it lies between two rows of truth at most max_gap apart.
/// Both trajectories must pass check_trajectory().
std::vector<PosePair> associate(const std::vector<TimedPose>& estimate,
                                const std::vector<TimedPose>& truth, TimeNs max_gap,
                                TimeNs time_offset = 0);

}  // namespace vio
