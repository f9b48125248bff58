// A rawlog, plain or compressed: streams and every message.
#include "libvio/io/rawlog_info.h"
#include "libvio/io/recording.h"
#include "tests/fuzz/fuzz_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace vio;
    const std::string file = fuzz::write("input.rawlog", data, size);
    fuzz::expect_result_or_line([&] { read_rawlog_info(file); });
    fuzz::expect_result_or_line([&] {
        Recording recording(file);
        while (recording.next()) {
        }
    });
    return 0;
}
