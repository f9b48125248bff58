// Tables of a logger, or a drive of KITTI, in which one file is the input (the first byte chooses),
// the others being good.
#include "libvio/io/csv_import.h"
#include "libvio/io/kitti_import.h"
#include "tests/fuzz/fuzz_file.h"

namespace {

struct File {
    const char* name;
    const char* good;
};

constexpr File kTables[] = {{"gyro.csv", "t,x,y,z\n1.00,0,0,0\n1.01,0,0,0\n1.02,0,0,0\n"},
                            {"accel.csv", "1000,0,0,9.81\n1009,0,0,9.81\n1018,0,0,9.81\n"}};
constexpr File kDrive[] = {
    {"drive/image_00/timestamps.txt", "2011-09-26 13:02:25.965000001\n"},
    {"drive/oxts/timestamps.txt", "2011-09-26 13:02:25.960000001\n2011-09-26 13:02:25.970000001\n"},
    {"drive/oxts/data/0000000000.txt",
     "49 8 116 0.03 0.01 -0.61 0 0 0 0 0 0.1 0.2 9.8 0 0 0 0.01 0 0 0 0 0 0 0 4 9 4 4 0\n"},
    {"drive/oxts/dataformat.txt",
     "lat: \nlon: \nalt: \nroll: \npitch: \nyaw: \nvn: \nve: \nvf: \nvl: \nvu: \nax: \nay: \naz: \n"
     "af: \nal: \nau: \nwx: \nwy: \nwz: \nwf: \nwl: \nwu: \npos_accuracy: \nvel_accuracy: \n"
     "navstat: \nnumsats: \nposmode: \nvelmode: \norimode: \n"},
    {"drive/calib_imu_to_velo.txt", "R: 1 0 0 0 1 0 0 0 1\nT: -0.81 0.32 -0.80\n"},
    {"drive/calib_velo_to_cam.txt", "R: 0 -1 0 0 0 -1 1 0 0\nT: -0.004 -0.076 -0.272\n"},
    {"drive/calib_cam_to_cam.txt",
     "S_00: 4 3\nK_00: 3 0 1.5 0 3 1 0 0 1\nD_00: 0 0 0 0 0\nR_00: 1 0 0 0 1 0 0 0 1\n"
     "T_00: 0 0 0\nS_rect_00: 4 3\nR_rect_00: 1 0 0 0 1 0 0 0 1\n"
     "P_rect_00: 3 0 1.5 0 0 3 1 0 0 0 1 0\n"}};

template <std::size_t kCount>
void write(const File (&files)[kCount], std::size_t chosen, const std::uint8_t* data,
           std::size_t size) {
    for (std::size_t i = 0; i < kCount; ++i)
        if (i == chosen)
            vio::fuzz::write(files[i].name, data, size);
        else
            vio::fuzz::write(files[i].name, files[i].good,
                             std::char_traits<char>::length(files[i].good));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace vio;
    if (size == 0) return 0;
    const std::string out = fuzz::folder() + "/out.rawlog";
    const std::size_t chosen = data[0] % (std::size(kTables) + std::size(kDrive));
    if (chosen < std::size(kTables)) {
        write(kTables, chosen, data + 1, size - 1);
        CsvImportOptions options;
        options.gyro = {fuzz::folder() + "/gyro.csv", {"t", "x", "y", "z"}, "s"};
        options.accel = {fuzz::folder() + "/accel.csv", {"1", "2", "3", "4"}, "ms"};
        fuzz::expect_result_or_line([&] { import_csv(out, options); });
        return 0;
    }
    constexpr char kImage[] = "P5 4 3 255 grey  pixels";  // OpenCV goes by content
    fuzz::write("drive/image_00/data/0000000000.png", kImage, sizeof kImage - 1);
    write(kDrive, chosen - std::size(kTables), data + 1, size - 1);
    fuzz::expect_result_or_line([&] { import_kitti(fuzz::folder() + "/drive", out); });
    return 0;
}
