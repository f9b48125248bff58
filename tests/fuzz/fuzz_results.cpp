// A results folder in which one file is the input (the first byte chooses), the path being good.
#include "libvio/io/results.h"
#include "tests/fuzz/fuzz_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace vio;
    if (size == 0) return 0;
    constexpr char kPath[] = "1 0 0 0 0 0 0 1\n2 1 0 0 0 0 0 1\n";
    constexpr const char* kFiles[] = {"trajectory_cov.txt", "states.csv",   "innovations.csv",
                                      "landmarks.ply",      "summary.json", "calibration.ini"};
    const std::string folder = fuzz::folder() + "/results";
    std::filesystem::remove_all(folder);
    fuzz::write("results/trajectory.tum", kPath, sizeof kPath - 1);
    fuzz::write(std::string("results/") + kFiles[data[0] % std::size(kFiles)], data + 1, size - 1);
    fuzz::expect_result_or_line([&] { read_results(folder); });
    fuzz::expect_result_or_line([&] { read_results_rig(folder); });
    return 0;
}
