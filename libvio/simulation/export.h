// Files of a simulated experiment.
#pragma once

#include <functional>
#include <string>

#include "libvio/simulation/scenario.h"

namespace vio {

/// Writes X.rawlog with readings, images (if the scenario renders) and feature tracks (if it makes
/// them) in order of time, with the calibration in the rawlog's own fields and its sidecar; and the
/// truth beside it, as text with a header each:
///   X.truth.tum          T_W_B at the images, TUM format
///   X.truth_states.csv   velocity and biases at the images
///   X.truth_points.csv   the points behind the feature tracks
///   X.truth_odometry.csv, X.truth_gps.csv   where there are such messages
///   X.truth_calibration.ini   where the rawlog states another calibration
/// `progress`, if given, is called with the share done, 0 to 1. Throws InputError if a file cannot
/// be written or rawlog_file does not end in ".rawlog".
void write_simulation(const Simulation& simulation, const std::string& rawlog_file,
                      const std::function<void(double)>& progress = {});

}  // namespace vio
