// Offset between the clocks of an estimate and its truth.
#pragma once

#include <optional>
#include <vector>

#include "libvio/evaluation/association.h"
#include "libvio/geometry/alignment.h"

namespace vio {

/// The offset [s] within +-search_s that leaves the smallest RMS distance between the aligned
/// estimate and the truth interpolated at t + offset. Of `kind` kNone the worlds must be the same.
/// T_B_T: what the truth tracks. Nothing if fewer than three poses, or less than half as many as
/// there can be, meet truth; or if the best offset lies at the end of the range.
std::optional<double> estimate_time_offset(const std::vector<TimedPose>& estimate,
                                           const std::vector<TimedPose>& truth, const Pose& T_B_T,
                                           AlignmentKind kind, TimeNs max_gap, double search_s);

}  // namespace vio
