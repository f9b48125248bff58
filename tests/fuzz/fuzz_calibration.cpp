// Calibration files of every kind, INI and YAML; a camera that is made can be used. Descriptions of
// boards, and surveyed points.
#include "libvio/calibration/board_file.h"
#include "libvio/io/calibration_file.h"
#include "tests/fuzz/fuzz_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace vio;
    for (const char* name : {"input.ini", "input.yaml"}) {
        const std::string file = fuzz::write(name, data, size);
        fuzz::expect_result_or_line([&] {
            Rig rig;
            load_calibration(file, rig);
            if (rig.camera)
                for (const double share : {0.0, 0.3, 1.0})
                    if (const auto ray = rig.camera->ray(
                            {share * rig.camera->width(), share * rig.camera->height()}))
                        rig.camera->project(ray->origin + ray->direction);
            calibration_text(rig);
        });
        fuzz::expect_result_or_line([&] { read_board(file); });
    }
    return 0;
}
