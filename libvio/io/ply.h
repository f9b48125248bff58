// Landmarks as PLY.
#pragma once

#include <string>

#include "libvio/base/estimate.h"
#include "libvio/io/landmark_colour.h"

namespace vio {

/// How the rows are written.
struct PlyRows {
    bool binary = false;    ///< little-endian, else text
    bool wide_ids = false;  ///< see wide_ids()
};

/// True if an id does not fit the 32 bits of PLY's widest integer: every row then has it in two
/// parts, as the properties id = its lower and id_high = its upper 32 bits.
bool wide_ids(FeatureId least, FeatureId greatest);

/// A PLY's head and its rows, for writers that go landmark by landmark: x y z [m] in W (double),
/// red green blue, id, observations, covariance (upper triangle) [m^2], if need be id_high. ASCII
/// reads back to the bit.
std::string ply_header(size_t landmarks, LandmarkColour colour, const PlyRows& rows);
std::string ply_row(const LandmarkEstimate& landmark, const Rgb& rgb, const PlyRows& rows);

/// A whole file; throws InputError if it cannot be written.
void write_ply(const std::string& file, const std::vector<LandmarkEstimate>& landmarks,
               LandmarkColour colour, bool binary = false);

/// Reads what was written as ASCII. Throws InputError (file and line).
std::vector<LandmarkEstimate> read_ply(const std::string& file);

}  // namespace vio
