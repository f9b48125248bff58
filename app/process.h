// Programs started as processes of their own: this program's commands, and gnuplot.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace vio::app {

/// Path of this program.
std::string own_program();

/// Starts a program (found in PATH if it has no slash) with its output and errors in log_file.
/// Nothing is read from standard input. Unless the environment says otherwise, it computes in one
/// thread if `single_thread`. Throws InputError if it cannot be started.
pid_t start_process(const std::vector<std::string>& command, const std::string& log_file,
                    bool single_thread = false);

/// Waits for a process; its exit code, or -1 if it was killed.
int wait_for(pid_t process);

inline int run_process(const std::vector<std::string>& command, const std::string& log_file) {
    return wait_for(start_process(command, log_file));
}

/// Arguments in a text, separated by blanks; double quotes keep blanks together.
std::vector<std::string> split_arguments(const std::string& text);

/// A command line for a shell.
std::string shell_text(const std::vector<std::string>& command);

}  // namespace vio::app
