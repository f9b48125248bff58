// The program vio-slam run as its users run it.
#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

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

/// A failure with one line on stderr that begins as promised and contains each of the words.
inline void expect_one_line(const ProgramResult& result, const std::vector<std::string>& words,
                            const std::string& what = "") {
    EXPECT_GT(result.exit_code, 0) << what << "\n" << result.out << result.err;
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    EXPECT_EQ(result.err.rfind("vio-slam: error: ", 0), 0u) << result.err;
    for (const std::string& word : words)
        EXPECT_NE(result.err.find(word), std::string::npos)
            << what << "\n\"" << word << "\" is not in: " << result.err;
}

}  // namespace vio::test
