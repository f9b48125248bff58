// The section that MRPT's SLAM programs read from their configuration files.
#pragma once

#include <optional>
#include <string>

namespace vio {

/// [MappingApplication] as kf-slam and its like have it: the keys rawlog_file, logOutput_dir,
/// ground_truth_file, SAVE_3D_SCENES and SAVE_LOG_FREQUENCY. Others are theirs alone and passed
/// over.
struct MappingApplication {
    std::string rawlog_file, output_dir, ground_truth_file;  ///< empty: not given
    bool save_3d_scenes = false;
    int save_log_frequency = 1;  ///< [images]
};

/// Nothing if the file has no such section. Throws InputError (file, section, key) for a missing
/// file and for values that do not parse.
std::optional<MappingApplication> read_mapping_application(const std::string& ini_file);

}  // namespace vio
