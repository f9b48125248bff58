// Landmarks as PLY.
#pragma once

#include <string>

#include "libvio/base/estimate.h"
#include "libvio/io/landmark_colour.h"

namespace vio {

/// A PLY's head and its rows, for writers that go landmark by landmark: x y z [m] in W (double),
/// red green blue, id, observations, covariance (upper triangle) [m^2]. ASCII reads back to the
/// bit.
std::string ply_header(size_t landmarks, LandmarkColour colour, bool binary = false);
std::string ply_row(const LandmarkEstimate& landmark, const Rgb& rgb, bool binary = false);

/// A whole file; throws InputError if it cannot be written.
void write_ply(const std::string& file, const std::vector<LandmarkEstimate>& landmarks,
               LandmarkColour colour, bool binary = false);

/// Reads what was written as ASCII. Throws InputError (file and line).
std::vector<LandmarkEstimate> read_ply(const std::string& file);

}  // namespace vio
