// vio-slam: one program, one sub-command for each thing that users do.
#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <iostream>
#include <string>

#include "app/commands.h"
#include "app/manual.h"
#include "app/usage.h"
#include "app/version.h"
#include "libvio/base/errors.h"

namespace {

// Exit codes: 0 done, 1 bad input or failed estimate, 2 wrong use of the command line.
int report_error(const std::string& message, int exit_code) {
    // Exceptions of other libraries go on with a call stack in further lines.
    std::cerr << "vio-slam: error: " << message.substr(0, message.find('\n')) << std::endl;
    return exit_code;
}

// What was printed may be what the user came for: a full disk is to be told.
int finished() {
    return std::fflush(stdout) == 0 && !std::ferror(stdout)
               ? 0
               : report_error("standard output cannot be written; is the disk full?", 1);
}

int run_command_line(int argc, char** argv) {
    CLI::App program{
        "Motion, structure and gravity from a camera and an IMU, read from MRPT rawlogs."};
    program.name("vio-slam");
    program.formatter(vio::app::help_formatter());
    program.set_version_flag("--version", "vio-slam " VIO_VERSION);
    // For packaging: outside every group, so that --help does not show them.
    program
        .add_flag_callback("--print-man-page",
                           [&] {
                               std::cout << vio::app::manual_page(program, VIO_VERSION, VIO_DATE);
                               throw CLI::Success();
                           })
        ->group("");
    program
        .add_flag_callback("--print-bash-completion",
                           [&] {
                               std::cout << vio::app::bash_completion(program);
                               throw CLI::Success();
                           })
        ->group("");
    program.require_subcommand(0, 1);
    vio::app::add_run(program);
    vio::app::add_import(program);
    vio::app::add_track(program);
    vio::app::add_simulate(program);
    vio::app::add_slow(program);
    vio::app::add_sheet(program);
    vio::app::add_evaluate(program);
    vio::app::add_report(program);
    vio::app::add_sweep(program);
    vio::app::add_reproduce(program);
    vio::app::add_render(program);
    vio::app::add_export(program);
    vio::app::add_info(program);
    vio::app::add_check(program);
    vio::app::add_calibrate(program);
    vio::app::add_statistics(program);
    program.footer(
        "From a recording to a trajectory: import, check, run, evaluate, render; each with "
        "--help.");
    try {
        program.parse(argc, argv);
        if (program.get_subcommands().empty())
            return report_error("no command given; see vio-slam --help", 2);
    } catch (const CLI::ParseError& error) {
        if (error.get_exit_code() == 0) return program.exit(error);  // --help, --version
        return report_error(vio::app::usage_error(program, error), 2);
    }
    return finished();
}

}  // namespace

int main(int argc, char** argv) {
    // A file that reaches the limit of its size is to raise an error like a full disk.
    std::signal(SIGXFSZ, SIG_IGN);
    try {
        return run_command_line(argc, argv);
    } catch (const vio::InputError& error) {
        return report_error(error.what(), 1);
    } catch (const std::exception& error) {
        return report_error(std::string("unexpected: ") + error.what(), 1);
    }
}
