// Compressed parts of bags.
#pragma once

#include <memory>
#include <optional>

#include "libvio/ros2/cdr.h"

namespace vio {

/// What came out of compressed data; its memory is used again.
class Unpacked {
 public:
    Bytes bytes() const { return {data_.get(), size_}; }
    /// Room for as many bytes, their values open. False for more than a bag's part has, as damaged
    /// data ask for.
    bool resize(std::uint64_t size);
    std::uint8_t* data() { return data_.get(); }

 private:
    std::unique_ptr<std::uint8_t[]> data_;
    std::size_t size_ = 0, room_ = 0;
};

/// Whether the data begin as a Zstandard frame does.
bool is_zstd(Bytes data);

/// Unpacks a Zstandard frame of `size` bytes, or of as many as it says itself. False where the data
/// are damaged.
bool unpack_zstd(Bytes packed, Unpacked& unpacked, std::optional<std::uint64_t> size = {});
/// The same of LZ4's frames.
bool unpack_lz4(Bytes packed, Unpacked& unpacked, std::uint64_t size);

}  // namespace vio
