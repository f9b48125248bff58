// A file of a ROS 2 bag, in either storage.
#include "libvio/ros2/bag.h"
#include "libvio/ros2/ros2_import.h"
#include "tests/fuzz/fuzz_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace vio;
    const std::string bag = fuzz::write("bag", data, size);
    fuzz::expect_result_or_line([&] {
        Ros2ImportOptions options;
        if (Ros2Bag(bag).find("/truth")) options.truth_topic = "/truth";
        import_ros2(bag, fuzz::folder() + "/out.rawlog", options);
    });
    return 0;
}
