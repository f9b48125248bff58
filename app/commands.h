// The sub-commands of vio-slam. Each function declares one sub-command with its options; parsing
// the command line runs it. Bad input throws InputError; reports go to standard output.
#pragma once

#include <CLI/CLI.hpp>

namespace vio::app {

void add_run(CLI::App& program);
void add_import(CLI::App& program);
void add_track(CLI::App& program);
void add_simulate(CLI::App& program);
void add_slow(CLI::App& program);
void add_sheet(CLI::App& program);
void add_evaluate(CLI::App& program);
void add_report(CLI::App& program);
void add_sweep(CLI::App& program);
void add_reproduce(CLI::App& program);
void add_render(CLI::App& program);
void add_export(CLI::App& program);
void add_info(CLI::App& program);
void add_check(CLI::App& program);
void add_calibrate(CLI::App& program);
void add_statistics(CLI::App& program);

}  // namespace vio::app
