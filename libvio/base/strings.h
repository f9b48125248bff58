// Pieces of text.
#pragma once

#include <string_view>

namespace vio {

/// Without the blanks at both ends.
std::string_view trimmed(std::string_view text);

/// The value of an INI file's line without the comment behind it, which MRPT's reader leaves in: it
/// begins with #, ; or //, at the beginning or after a blank (so that names may hold them).
std::string_view without_comment(std::string_view value);

}  // namespace vio
