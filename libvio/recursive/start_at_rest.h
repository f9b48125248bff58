// Starts of the filter that need no motion, and starts that continue an earlier path.
#pragma once

#include "libvio/batch/batch.h"
#include "libvio/recursive/rest.h"

namespace vio {

/// State at the end of a stretch of rest, with no points. The mean specific force is gravity plus
/// the accelerometer's bias, whose prior (BatchOptions::accel_bias_sigma) makes the tilt uncertain,
/// correlated with it; the mean angular rate is the gyro's bias. Position and yaw are zero: here W
/// begins.
BatchTail start_at_rest(const Stillness& rest, TimeNs t, const Rig& rig,
                        const BatchOptions& priors);

/// The same start in the world of another estimate: moved by yaw and position so that the pose
/// `from`, at which the start's own world begins, comes to the pose of the state `known`, whose
/// uncertainty of yaw (at most that of any yaw) and position all of the start then shares.
BatchTail continued(const BatchTail& start, const Pose& from, const StateEstimate& known);

}  // namespace vio
