// Where recorded data sets are, for tests that need them.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

namespace vio::test {

/// Path of a recorded data set: in $VIO_DATA, else in shared/data beside the sources. It need not
/// exist: tests skip then.
inline std::filesystem::path recorded_data(const std::string& name) {
    const char* folder = std::getenv("VIO_DATA");
    const std::filesystem::path base =
        folder ? folder : std::filesystem::path(VIO_SOURCE_DIR) / ".." / "shared" / "data";
    return base / name;
}

}  // namespace vio::test

/// Skips the test, saying so, where the data set is absent.
#define VIO_NEED_DATA(path)             \
    if (!std::filesystem::exists(path)) \
    GTEST_SKIP() << (path).string() << " is absent; set VIO_DATA to the folder of recorded data"
