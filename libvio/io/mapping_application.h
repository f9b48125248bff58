// The section that MRPT's SLAM programs read from their configuration files.
#pragma once

#include <optional>
#include <string>

namespace vio {

/// [MappingApplication] as kf-slam and its like have it. Keys that are not listed here are theirs
/// alone and passed over.
struct MappingApplication {
    std::string rawlog_file, logOutput_dir, ground_truth_file;  ///< empty: not given
    bool SAVE_3D_SCENES = false;
    int SAVE_LOG_FREQUENCY = 1;  ///< [images]
};

/// Nothing if the file has no such section. Throws InputError (file, section, key) for a missing
/// file and for values that do not parse.
std::optional<MappingApplication> read_mapping_application(const std::string& ini_file);

}  // namespace vio
