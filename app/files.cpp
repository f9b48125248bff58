#include "app/files.h"

#include <filesystem>

#include "libvio/base/errors.h"

namespace vio::app {

void sort_files(const std::vector<std::string>& files, std::string& config, std::string& rawlog) {
    for (const std::string& file : files) {
        const bool is_config = std::filesystem::path(file).extension() == ".ini";
        std::string& place = is_config ? config : rawlog;
        if (!place.empty())
            throw InputError(file + ": " + place + " is given already; there is one " +
                             (is_config ? "configuration" : "rawlog") + " at a time");
        place = file;
    }
}

}  // namespace vio::app
