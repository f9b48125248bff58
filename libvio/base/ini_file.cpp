#include "libvio/base/ini_file.h"

#include "libvio/base/errors.h"
#include "libvio/base/files.h"

namespace vio {

std::unique_ptr<const mrpt::config::CConfigFile> open_ini(const std::string& file) {
    if (!is_file(file)) throw InputError(file + ": no such file; name an existing INI file");
    try {
        return std::make_unique<const mrpt::config::CConfigFile>(file);
    } catch (const std::exception&) {  // a report of several lines
        throw InputError(file +
                         ": is not an INI file, or one of its directives $env{}, $eval{}, "
                         "@define is malformed; correct it");
    }
}

}  // namespace vio
