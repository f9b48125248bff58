// A trajectory: TUM, EuRoC, MRPT, KITTI.
#include "libvio/io/trajectory_io.h"
#include "tests/fuzz/fuzz_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace vio;
    constexpr char kTimes[] = "0\n0.1\n0.2\n";
    fuzz::write("path.times.txt", kTimes, sizeof kTimes - 1);
    const std::string file = fuzz::write("path.txt", data, size);
    fuzz::expect_result_or_line([&] { read_trajectory(file); });
    return 0;
}
