#include "libvio/io/foreign_input.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string_view>

#include "libvio/base/errors.h"

namespace vio {
namespace {

namespace fs = std::filesystem;
using namespace std::string_view_literals;

constexpr const char* kRos1 =
    "is a ROS 1 bag, no rawlog; convert it with MRPT's rosbag2rawlog: share/TUTORIAL.md, section 2";
constexpr const char* kRos2 =
    "is a ROS 2 bag, no rawlog; convert it: vio-slam import ros2 BAG -o NAME.rawlog";
constexpr const char* kArchive =
    "is an archive, no rawlog; unpack it, then `vio-slam import` what it holds";

struct Magic {
    std::string_view bytes;
    const char* problem;
};
const Magic kMagics[] = {{"#ROSBAG V"sv, kRos1},
                         {"SQLite format 3\0"sv, kRos2},
                         {"\x89MCAP0\r\n"sv, kRos2},
                         {"PK\x03\x04"sv, kArchive},
                         {"7z\xbc\xaf\x27\x1c"sv, kArchive}};

std::string import_command(const char* layout, const fs::path& folder) {
    fs::path named = fs::absolute(folder).lexically_normal();
    // "NAME/" ends in an empty name.
    if (!named.has_filename() || named.filename() == "mav0") named = named.parent_path();
    if (named.filename() == "mav0") named = named.parent_path();
    return "; convert it: vio-slam import " + std::string(layout) + " " + folder.string() + " -o " +
           named.filename().string() + ".rawlog";
}

bool holds(const fs::path& folder, const char* name) {
    std::error_code error;
    return fs::exists(folder / name, error);
}

bool has_folder_like(const fs::path& folder, std::string_view beginning, const char* file) {
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(folder, error))
        if (entry.path().filename().string().starts_with(beginning) &&
            fs::exists(entry.path() / file, error))
            return true;
    return false;
}

std::string problem_of_folder(const fs::path& folder) {
    if (holds(folder, "metadata.yaml")) return kRos2;
    if (holds(folder, "trajectory.tum"))
        return "is a results folder, no rawlog; name the recording";
    if (holds(folder, "mav0/cam0") && holds(folder, "dso/camchain.yaml"))
        return "is a TUM-VI data set, no rawlog" + import_command("tum-vi", folder);
    if (holds(folder, "mav0") || has_folder_like(folder, "cam", "sensor.yaml") ||
        has_folder_like(folder, "imu", "sensor.yaml"))
        return "is a data set in ASL layout, no rawlog" + import_command("asl", folder);
    if (holds(folder, "oxts") && has_folder_like(folder, "image_", "timestamps.txt"))
        return "is a drive of KITTI, no rawlog" + import_command("kitti", folder);
    return "is a folder, no rawlog; of which kinds of recordings a rawlog can be made: "
           "vio-slam import --help";
}

}  // namespace

void refuse_foreign_input(const std::string& path) {
    std::error_code error;
    if (fs::is_directory(path, error)) throw InputError(path + ": " + problem_of_folder(path));
    if (!fs::is_regular_file(path, error)) return;
    char bytes[16] = {};
    std::ifstream file(path, std::ios::binary);
    file.read(bytes, sizeof bytes);
    const std::string_view beginning(bytes, static_cast<size_t>(file.gcount()));
    for (const Magic& magic : kMagics)
        if (beginning.starts_with(magic.bytes)) throw InputError(path + ": " + magic.problem);
}

}  // namespace vio
