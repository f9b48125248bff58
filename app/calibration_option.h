// The option --calibration, as every command that reads a recording has it.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace vio::app {

/// Files in the order given; each overrides those before it.
inline void add_calibration_option(CLI::App& command, std::vector<std::string>& files,
                                   const std::string& use = "") {
    command
        .add_option("--calibration", files,
                    use +
                        "Calibration of camera or IMU that overrides the rawlog's "
                        "(share/formats.md); may be repeated")
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
}

}  // namespace vio::app
