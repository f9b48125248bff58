// JSON as text.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace vio {

/// Indented, with a line end. Names in files (sensor labels, paths) need not be UTF-8: bytes that
/// are not become U+FFFD, where dump() alone would throw.
template <typename Json>
std::string json_text(const Json& json) {
    return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace vio
