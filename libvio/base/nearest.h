// What a misspelt name was probably meant to be.
#pragma once

#include <string>
#include <vector>

namespace vio {

/// The candidate that fewest changes of single letters (one put in, left out, replaced, or
/// exchanged with its neighbour) make of `word`; empty if that takes more than one change and
/// more than a third of its letters.
std::string nearest(const std::string& word, const std::vector<std::string>& candidates);

}  // namespace vio
