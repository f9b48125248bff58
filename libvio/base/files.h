// What there is on disk, by names that may come from a user or from a file: std::filesystem throws
// where the system will not look (a name too long, a folder that may not be entered). Nothing is
// there, then.
#pragma once

#include <filesystem>
#include <system_error>

namespace vio {

inline bool is_there(const std::filesystem::path& path) {
    std::error_code ignored;
    return std::filesystem::exists(path, ignored);
}

inline bool is_file(const std::filesystem::path& path) {
    std::error_code ignored;
    return std::filesystem::is_regular_file(path, ignored);
}

inline bool is_folder(const std::filesystem::path& path) {
    std::error_code ignored;
    return std::filesystem::is_directory(path, ignored);
}

}  // namespace vio
