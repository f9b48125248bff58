// Zero-velocity update.
#pragma once

#include "libvio/recursive/filter_state.h"

namespace vio {

/// The body rests: its velocity is zero, and it is where it was at an earlier clone. Measured in
/// the body's own axes, so that yaw and position of the world stay free. Left out where the state
/// contradicts it by a chi-square test with the given probability; returns whether it was used.
/// The core has a velocity.
bool update_at_rest(FilterState& state, int earlier_slot, double gate);

}  // namespace vio
