// What the fuzzers share: the input as a file, and what a reader may throw.
#pragma once

#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "libvio/base/errors.h"

namespace vio::fuzz {

/// Folder in memory for this process's files.
inline const std::string& folder() {
    static const std::string path = [] {
        const std::string name = "/dev/shm/vio_fuzz_" + std::to_string(::getpid());
        std::filesystem::create_directories(name);
        std::atexit([] {
            std::error_code none;
            std::filesystem::remove_all("/dev/shm/vio_fuzz_" + std::to_string(::getpid()), none);
        });
        return name;
    }();
    return path;
}

inline std::string write(const std::string& name, const char* data, std::size_t size) {
    const std::string file = folder() + "/" + name;
    std::filesystem::create_directories(std::filesystem::path(file).parent_path());
    std::ofstream(file, std::ios::binary).write(data, static_cast<std::streamsize>(size));
    return file;
}

inline std::string write(const std::string& name, const std::uint8_t* data, std::size_t size) {
    return write(name, reinterpret_cast<const char*>(data), size);
}

/// Reads: succeeds, or throws InputError with one line. Anything else is a finding.
template <typename Read>
void expect_result_or_line(Read read) {
    try {
        read();
    } catch (const InputError& error) {
        const std::string line = error.what();
        if (line.empty() || line.find('\n') != std::string::npos) {
            std::fprintf(stderr, "not one line: %s\n", line.c_str());
            std::abort();
        }
    }
}

}  // namespace vio::fuzz
