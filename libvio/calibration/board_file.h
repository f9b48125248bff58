// Files that describe calibration targets.
#pragma once

#include <string>

#include "libvio/calibration/board.h"

namespace vio {

/// By content: Kalibr's target.yaml (target_type aprilgrid: tagCols, tagRows, tagSize, tagSpacing;
/// checkerboard: targetCols, targetRows, rowSpacingMeters, colSpacingMeters), or rows
/// id,x,y,z[,sigma] [m] of surveyed points, as read_fiducials() takes them. Throws InputError
/// (file, key or line) where it is neither.
Board read_board(const std::string& file);

/// Points alone: rows id,x,y,z[,sigma in each direction] [m]; without sigma, or with zero, exactly
/// known.
std::map<FeatureId, Fiducial> read_fiducials(const std::string& file);

}  // namespace vio
