#include "libvio/base/errors.h"

namespace vio {
namespace {

std::string visible(const std::string& text) {
    constexpr const char* kDigits = "0123456789abcdef";
    std::string shown;
    for (const char c : text) {
        const auto code = static_cast<unsigned char>(c);
        if (c == '\n')
            shown += "\\n";
        else if (c == '\t')
            shown += "\\t";
        else if (c == '\r')
            shown += "\\r";
        else if (code < 0x20 || code == 0x7f)
            shown += {'\\', 'x', kDigits[code >> 4], kDigits[code & 15]};
        else
            shown += c;
    }
    return shown;
}

}  // namespace

InputError::InputError(const std::string& message) : std::runtime_error(visible(message)) {}

}  // namespace vio
