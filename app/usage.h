// What is said of a command line that cannot be understood.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace vio::app {

/// One line: what is wrong, the command or option that was probably meant, and whose help to read.
std::string usage_error(const CLI::App& program, const CLI::ParseError& error);

}  // namespace vio::app
