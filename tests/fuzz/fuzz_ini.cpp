// INI files: options, the section of MRPT's SLAM programs, scenarios.
#include "libvio/batch/batch.h"
#include "libvio/io/mapping_application.h"
#include "libvio/recursive/iekf.h"
#include "libvio/simulation/scenario_options.h"
#include "libvio/tracking/tracker.h"
#include "tests/fuzz/fuzz_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace vio;
    const std::string file = fuzz::write("input.ini", data, size);
    fuzz::expect_result_or_line([&] {
        TrackerOptions tracker;
        BatchOptions batch;
        IekfOptions iekf;
        OptionSet options;
        tracker.describe(options);
        batch.describe(options);
        iekf.describe(options);
        options.load(file);
        options.to_ini();
    });
    fuzz::expect_result_or_line([&] { read_mapping_application(file); });
    fuzz::expect_result_or_line([&] { ScenarioOptions::from_file(file); });
    return 0;
}
