#include "libvio/check/finding.h"

#include <cstdarg>
#include <cstdio>

namespace vio {

const char* to_string(Grade grade) {
    switch (grade) {
        case Grade::untested:
            return "untested";
        case Grade::ok:
            return "ok";
        case Grade::warning:
            return "warning";
        case Grade::error:
            break;
    }
    return "error";
}

std::string one_line(const Finding& finding) {
    std::string line = finding.name + ": " + finding.measured;
    if (!finding.limit.empty()) line += " (" + finding.limit + ")";
    if (!finding.advice.empty()) line += ": " + finding.advice;
    return line;
}

std::string formatted(const char* format, ...) {
    char buffer[512];
    std::va_list arguments;
    va_start(arguments, format);
    std::vsnprintf(buffer, sizeof buffer, format, arguments);
    va_end(arguments);
    return buffer;
}

}  // namespace vio
