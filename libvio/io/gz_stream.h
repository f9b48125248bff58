// gzip-compressed files, read and written strictly: every shortfall is an error.
#pragma once

#include <zlib.h>

#include <cstddef>
#include <cstdint>
#include <string>

namespace vio {

/// Reads a file, gzip-compressed or plain. Usable as the stream of an mrpt archive.
class GzInput {
 public:
    /// Throws InputError if the file does not exist or cannot be opened.
    explicit GzInput(const std::string& file);
    ~GzInput();
    GzInput(const GzInput&) = delete;
    GzInput& operator=(const GzInput&) = delete;

    /// Reads exactly count bytes. Throws std::runtime_error (the reason only) where the file ends
    /// before or the compressed data are damaged.
    size_t Read(void* buffer, size_t count);
    size_t Write(const void*, size_t);  ///< always throws
    std::string getStreamDescription() const { return file_; }

    /// True at the clean end. Throws std::runtime_error if the file is cut off here.
    bool at_end();

    /// Reads one line without its end ("\n" or "\r\n"); false at the clean end. Throws as Read
    /// does.
    bool getline(std::string& line);

    const std::string& file() const { return file_; }
    std::uint64_t position() const { return position_; }  ///< bytes of content read
    /// Why reading failed; empty while it has not.
    const std::string& failure() const { return failure_; }
    double progress() const;  ///< share of the file read, 0 to 1

 private:
    [[noreturn]] void fail();

    std::string file_, failure_;
    gzFile handle_ = nullptr;
    std::uint64_t position_ = 0;
    double file_size_ = 0;  ///< bytes on disk
};

/// Writes a gzip-compressed file whose bytes depend on nothing but the content. Usable as the
/// stream of an mrpt archive.
class GzOutput {
 public:
    /// Level 1 compresses recordings as well as 9 does, four times faster. Throws InputError if the
    /// file cannot be made.
    explicit GzOutput(const std::string& file, int level = 1);
    ~GzOutput();
    GzOutput(const GzOutput&) = delete;
    GzOutput& operator=(const GzOutput&) = delete;

    /// Throws InputError if the disk is full.
    size_t Write(const void* buffer, size_t count);
    size_t Read(void*, size_t);  ///< always throws
    std::string getStreamDescription() const { return file_; }

    /// Completes the file. Throws InputError if the disk is full.
    void close();

 private:
    std::string file_;
    gzFile handle_ = nullptr;
};

}  // namespace vio
