// Manual page and shell completion, from the same declarations as --help.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace vio::app {

/// "vio-slam calibrate imu"
std::string full_name(const CLI::App& app);

/// The program with all its commands and their options as one page, man(7) macros. `version` and
/// `date` (YYYY-MM-DD, may be empty) go into its margins.
std::string manual_page(const CLI::App& program, const std::string& version,
                        const std::string& date);

/// Script for bash-completion: commands, options, and values where an option has a choice; file
/// names elsewhere.
std::string bash_completion(const CLI::App& program);

}  // namespace vio::app
