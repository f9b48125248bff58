// An ASL data set whose readings, features, truth or sensor file is the input (the first byte
// chooses), the others being good.
#include "libvio/io/asl_import.h"
#include "tests/fuzz/fuzz_file.h"

namespace {

constexpr char kCamera[] =
    "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]\n"
    "rate_hz: 20\nresolution: [64, 48]\ncamera_model: pinhole\nintrinsics: [50, 50, 31.5, 23.5]\n"
    "distortion_model: radial-tangential\ndistortion_coefficients: [0, 0, 0, 0]\n";
constexpr char kImu[] =
    "sensor_type: imu\nT_BS:\n  cols: 4\n  rows: 4\n  data: [1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]\n"
    "rate_hz: 200\ngyroscope_noise_density: 1.7e-4\ngyroscope_random_walk: 1.9e-5\n"
    "accelerometer_noise_density: 2e-3\naccelerometer_random_walk: 3e-3\n";
constexpr char kReadings[] = "1000000000,0,0,0,0,0,9.81\n1005000000,0,0,0,0,0,9.81\n";
constexpr char kFeatures[] = "1000000000,1,10,20\n1000000000,2,30,20\n1050000000,1,11,20\n";
constexpr char kTruth[] = "1000000000,0,0,0,1,0,0,0\n1050000000,0,0,0,1,0,0,0\n";

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace vio;
    if (size == 0) return 0;
    struct {
        const char* name;
        const char* good;
    } const files[] = {{"mav0/imu0/data.csv", kReadings},
                       {"mav0/cam0/features.csv", kFeatures},
                       {"mav0/state_groundtruth_estimate0/data.csv", kTruth},
                       {"mav0/cam0/sensor.yaml", kCamera},
                       {"mav0/imu0/sensor.yaml", kImu}};
    const std::size_t chosen = data[0] % std::size(files);
    for (std::size_t i = 0; i < std::size(files); ++i) {
        if (i == chosen)
            fuzz::write(files[i].name, data + 1, size - 1);
        else
            fuzz::write(files[i].name, files[i].good,
                        std::char_traits<char>::length(files[i].good));
    }
    fuzz::expect_result_or_line(
        [&] { import_asl(fuzz::folder(), fuzz::folder() + "/out.rawlog"); });
    return 0;
}
