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
    int count = 0;
    TimeNs first = 0, last = 0;  ///< smallest and largest stamp
    TimeNs median_interval = 0;  ///< between neighbouring stamps in file order
    TimeNs largest_gap = 0;      ///< likewise
    TimeNs largest_gap_at = 0;   ///< stamp before that gap
    int backward_stamps = 0;     ///< stamps that do not increase
    Pose T_B_S;                  ///< sensor S in the vehicle frame, at its first observation
};

struct RawlogInfo {
    std::vector<StreamInfo> streams;  ///< in order of first appearance
    std::string damage;               ///< why reading stopped early; empty: the whole file was read
};

/// Reads the whole file. `progress` receives the share done, 0 to 1. Throws InputError for a file
/// that is missing or no rawlog from its first object on.
RawlogInfo read_rawlog_info(const std::string& file,
                            const std::function<void(double)>& progress = {});

}  // namespace vio
