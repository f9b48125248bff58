#include "libvio/base/strings.h"

namespace vio {

std::string_view trimmed(std::string_view text) {
    constexpr std::string_view kBlanks = " \t\r\n";
    const auto begin = text.find_first_not_of(kBlanks);
    if (begin == std::string_view::npos) return {};
    return text.substr(begin, text.find_last_not_of(kBlanks) - begin + 1);
}

std::string_view without_comment(std::string_view value) {
    bool after_blank = true;
    for (std::size_t i = 0; i < value.size(); ++i) {
        const std::string_view rest = value.substr(i);
        const bool begins = rest[0] == '#' || rest[0] == ';' || rest.starts_with("//");
        if (after_blank && begins) return trimmed(value.substr(0, i));
        after_blank = rest[0] == ' ' || rest[0] == '\t';
    }
    return trimmed(value);
}

}  // namespace vio
