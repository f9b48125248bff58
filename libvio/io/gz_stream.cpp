#include "libvio/io/gz_stream.h"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <stdexcept>

#include "libvio/base/errors.h"

namespace vio {
namespace {

constexpr unsigned kBufferBytes = 1 << 18;

// zlib counts in int.
unsigned chunk(size_t bytes) {
    return static_cast<unsigned>(
        std::min<size_t>(bytes, static_cast<size_t>(std::numeric_limits<int>::max())));
}

}  // namespace

GzInput::GzInput(const std::string& file) : file_(file) {
    std::error_code error;
    if (!std::filesystem::exists(file, error))
        throw InputError(file + ": no such file; check the path");
    if (!std::filesystem::is_regular_file(file, error))
        throw InputError(file + ": not a file; name a file");
    file_size_ = static_cast<double>(std::filesystem::file_size(file, error));
    handle_ = gzopen(file.c_str(), "rb");
    if (!handle_) throw InputError(file + ": cannot be opened; check its permissions");
    gzbuffer(handle_, kBufferBytes);
}

GzInput::~GzInput() {
    gzclose(handle_);
}

void GzInput::fail() {
    int code = Z_OK;
    gzerror(handle_, &code);
    failure_ = code == Z_OK || code == Z_BUF_ERROR ? "the file is cut off"
                                                   : "the compressed data are damaged";
    throw std::runtime_error(failure_);
}

size_t GzInput::Read(void* buffer, size_t count) {
    auto* out = static_cast<char*>(buffer);
    for (size_t left = count; left > 0;) {
        const int got = gzread(handle_, out, chunk(left));
        if (got <= 0) fail();
        out += got;
        left -= static_cast<size_t>(got);
        position_ += static_cast<std::uint64_t>(got);
    }
    return count;
}

size_t GzInput::Write(const void*, size_t) {
    throw std::logic_error(file_ + " is read-only");
}

bool GzInput::at_end() {
    const int c = gzgetc(handle_);
    if (c >= 0) {
        gzungetc(c, handle_);
        return false;
    }
    int code = Z_OK;
    gzerror(handle_, &code);
    if (code != Z_OK) fail();
    return true;
}

bool GzInput::getline(std::string& line) {
    line.clear();
    if (at_end()) return false;
    char part[4096];
    while (gzgets(handle_, part, sizeof part)) {
        line += part;
        if (!line.empty() && line.back() == '\n') break;
    }
    int code = Z_OK;
    gzerror(handle_, &code);
    if (code != Z_OK) fail();
    position_ += line.size();
    while (!line.empty() && (line.back() == '\n' || line.back() == '\r')) line.pop_back();
    return true;
}

double GzInput::progress() const {
    if (file_size_ <= 0) return 1;
    return std::clamp(static_cast<double>(gzoffset(handle_)) / file_size_, 0.0, 1.0);
}

// zlib's gz functions write neither name nor time stamp into the header.
GzOutput::GzOutput(const std::string& file, int level)
    : file_(file), handle_(gzopen(file.c_str(), ("wb" + std::to_string(level)).c_str())) {
    if (!handle_) throw InputError(file + ": cannot be written; check folder and permissions");
    gzbuffer(handle_, kBufferBytes);
}

GzOutput::~GzOutput() {
    if (handle_) gzclose(handle_);
}

size_t GzOutput::Write(const void* buffer, size_t count) {
    const auto* in = static_cast<const char*>(buffer);
    for (size_t left = count; left > 0;) {
        const int put = gzwrite(handle_, in, chunk(left));
        if (put <= 0) throw InputError(file_ + ": cannot be written; is the disk full?");
        in += put;
        left -= static_cast<size_t>(put);
    }
    return count;
}

size_t GzOutput::Read(void*, size_t) {
    throw std::logic_error(file_ + " is write-only");
}

void GzOutput::close() {
    gzFile handle = handle_;
    handle_ = nullptr;
    if (handle && gzclose(handle) != Z_OK)
        throw InputError(file_ + ": cannot be completed; is the disk full?");
}

}  // namespace vio
