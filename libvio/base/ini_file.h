// MRPT's INI files, opened strictly.
#pragma once

#include <mrpt/config/CConfigFile.h>

#include <memory>
#include <string>

namespace vio {

/// Throws InputError for a missing file, and where MRPT cannot make sense of its directives
/// ($env{...}, $eval{...}, @define).
std::unique_ptr<const mrpt::config::CConfigFile> open_ini(const std::string& file);

}  // namespace vio
