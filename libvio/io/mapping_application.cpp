#include "libvio/io/mapping_application.h"

#include "libvio/base/ini_file.h"
#include "libvio/io/text.h"

namespace vio {

std::optional<MappingApplication> read_mapping_application(const std::string& ini_file) {
    const std::string section = "MappingApplication";
    const auto opened = open_ini(ini_file);
    const auto& ini = *opened;
    if (!ini.sectionExists(section)) return std::nullopt;
    const auto text = [&](const char* key) {
        return std::string(without_comment(ini.read_string(section, key, "")));
    };
    const auto whole_number = [&](const char* key, int otherwise, int least) {
        const std::string word = text(key);
        if (word.empty()) return otherwise;
        const auto number = parse_integer(word == "true"    ? "1"
                                          : word == "false" ? "0"
                                                            : std::string_view(word));
        if (!number || *number < least || *number > 1'000'000'000)
            throw InputError(ini_file + " [" + section + "] " + key + ": '" + word +
                             "' is no whole number of at least " + std::to_string(least));
        return static_cast<int>(*number);
    };
    MappingApplication keys;
    keys.rawlog_file = text("rawlog_file");
    keys.output_dir = text("logOutput_dir");
    keys.ground_truth_file = text("ground_truth_file");
    keys.save_3d_scenes = whole_number("SAVE_3D_SCENES", 0, 0) != 0;
    keys.save_log_frequency = whole_number("SAVE_LOG_FREQUENCY", 1, 1);
    return keys;
}

}  // namespace vio
