// The one exception that bad input or configuration raises.
#pragma once

#include <stdexcept>
#include <string>

namespace vio {

/// Bad input or configuration. what() is one line that says where, what is wrong and what to do:
/// "FILE (place): problem; remedy".
class InputError : public std::runtime_error {
 public:
    /// Control characters in the message, which may quote damaged files, are shown as in C sources.
    explicit InputError(const std::string& message);
};

}  // namespace vio
