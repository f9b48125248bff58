// The program vio-slam run as its users run it.
#pragma once

#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>

namespace vio::test {

struct ProgramResult {
    int exit_code = -1;  ///< -1: killed by a signal
    std::string out, err;
};

inline std::string read_text(const std::string& file) {
    std::ifstream in(file);
    std::ostringstream text;
    text << in.rdbuf();
    return text.str();
}

/// Runs `vio-slam ARGUMENTS` through the shell; folder receives its output meanwhile. environment:
/// assignments for this run.
inline ProgramResult vio_slam(const std::string& arguments, const std::string& folder,
                              const std::string& environment = "") {
    const std::string out = folder + "/stdout.txt", err = folder + "/stderr.txt";
    const std::string command = environment + " '" + VIO_SLAM_PROGRAM + "' " + arguments + " >'" +
                                out + "' 2>'" + err + "'";
    const int status = std::system(command.c_str());
    ProgramResult result;
    if (WIFEXITED(status)) result.exit_code = WEXITSTATUS(status);
    result.out = read_text(out);
    result.err = read_text(err);
    return result;
}

}  // namespace vio::test
