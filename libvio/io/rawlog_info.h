// What a rawlog contains, stream by stream.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "libvio/base/types.h"
#include "libvio/geometry/pose.h"

namespace vio {

/// The observations of one class with one sensor label.
struct StreamInfo {
    std::string label, class_name;
    Pose T_B_S;                  ///< sensor S in the vehicle frame, at its first observation
    std::vector<TimeNs> stamps;  ///< in order of the file
};

/// The streams of a rawlog, as far as it could be read.
struct RawlogInfo {
    std::vector<StreamInfo> streams;  ///< in order of first appearance
    std::string damage;               ///< why reading stopped early; empty: the whole file was read
};

/// Reads the whole file. `progress` receives the share done, 0 to 1. Throws InputError for a file
/// that is missing or no rawlog from its first object on.
RawlogInfo read_rawlog_info(const std::string& file,
                            const std::function<void(double)>& progress = {});

}  // namespace vio
