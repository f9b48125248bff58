// What an estimator tells of its course.
#pragma once

#include <cstdint>
#include <string>

#include "libvio/base/types.h"

namespace vio {

/// Something that happened, worth telling.
struct StatusEntry {
    TimeNs t = 0;  ///< on the camera's clock
    std::string text;
    std::int64_t number = 0;  ///< of its estimator's, from 0 on; those forgotten count
};

}  // namespace vio
