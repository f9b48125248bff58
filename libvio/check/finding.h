// What a check of a recording found.
#pragma once

#include <string>

namespace vio {

enum class Grade { untested, ok, warning, error };

/// "untested", "ok", "warning" or "error".
const char* to_string(Grade grade);

/// One line of a check: a quantity, its measured value and its limit, and what to do.
struct Finding {
    Grade grade = Grade::ok;
    std::string name;      ///< what was looked at, e.g. "IMU gaps"
    std::string measured;  ///< value with its unit; why it could not be measured if untested
    std::string limit;     ///< what it should be; empty: nothing to compare with
    std::string advice;    ///< what it means and what to do; empty if ok
};

/// "NAME: MEASURED (LIMIT): ADVICE", as `run` says it in passing.
std::string one_line(const Finding& finding);

/// printf into a string, for measured values.
[[gnu::format(printf, 1, 2)]] std::string formatted(const char* format, ...);

}  // namespace vio
