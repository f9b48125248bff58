// What an estimator tells of its course.
#pragma once

#include <string>

#include "libvio/base/types.h"

namespace vio {

/// Something that happened, worth telling.
struct StatusEntry {
    TimeNs t = 0;  ///< on the camera's clock
    std::string text;
};

}  // namespace vio
