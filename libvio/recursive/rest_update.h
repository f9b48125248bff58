// Zero-velocity update.
#pragma once

#include "libvio/recursive/filter_state.h"

namespace vio {

/// The body rests: its velocity is zero, and it is where it was at an earlier clone. Measured in
/// the body's own axes, so that yaw and position of the world stay free. Left out where the state
/// contradicts it by a chi-square test with the given probability; returns whether it was used.
/// The core has a velocity. hidden_velocity: what may pass for rest where images are coarse or
/// points far, as a standard deviation [m/s]; interval: since the clone was made [s].
bool update_at_rest(FilterState& state, int earlier_slot, double gate, double hidden_velocity,
                    double interval);

}  // namespace vio
