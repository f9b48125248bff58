#include "libvio/ros2/unpack.h"

#include <lz4frame.h>
#include <zstd.h>

#include <cstring>

namespace vio {
namespace {

// Far more than a chunk or an image has.
constexpr std::uint64_t kLargestUnpacked = 1 << 28;

}  // namespace

bool Unpacked::resize(std::uint64_t size) {
    if (size > kLargestUnpacked) return false;
    if (size > room_) {
        data_ = std::make_unique_for_overwrite<std::uint8_t[]>(size);
        room_ = size;
    }
    size_ = size;
    return true;
}

bool is_zstd(Bytes data) {
    constexpr std::uint8_t kMagic[] = {0x28, 0xb5, 0x2f, 0xfd};
    return data.size() > sizeof kMagic && std::memcmp(data.data(), kMagic, sizeof kMagic) == 0;
}

bool unpack_zstd(Bytes packed, Unpacked& unpacked, std::optional<std::uint64_t> size) {
    if (!size) {
        size = ZSTD_getFrameContentSize(packed.data(), packed.size());
        if (*size == ZSTD_CONTENTSIZE_UNKNOWN || *size == ZSTD_CONTENTSIZE_ERROR) return false;
    }
    if (!unpacked.resize(*size)) return false;
    return ZSTD_decompress(unpacked.data(), *size, packed.data(), packed.size()) == *size;
}

bool unpack_lz4(Bytes packed, Unpacked& unpacked, std::uint64_t size) {
    if (!unpacked.resize(size)) return false;
    LZ4F_dctx* context = nullptr;
    if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION))) return false;
    const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> owner(
        context, LZ4F_freeDecompressionContext);
    std::size_t written = 0;
    while (!packed.empty()) {
        std::size_t out = size - written, in = packed.size();
        const std::size_t code =
            LZ4F_decompress(context, unpacked.data() + written, &out, packed.data(), &in, nullptr);
        if (LZ4F_isError(code)) return false;
        written += out;
        packed = packed.subspan(in);
        if (code == 0) break;                   // the frame's end
        if (in == 0 && out == 0) return false;  // more than was stated
    }
    return written == size;
}

}  // namespace vio
