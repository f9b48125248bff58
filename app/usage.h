// What is said of a command line that cannot be understood.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <string>

namespace vio::app {

/// Lays --help out: arguments that may be several as NAME..., in brackets where they may be left
/// out.
std::shared_ptr<CLI::FormatterBase> help_formatter();

/// One line: what is wrong, the command or option that was probably meant, and whose help to read.
std::string usage_error(const CLI::App& program, const CLI::ParseError& error);

}  // namespace vio::app
