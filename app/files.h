// Files on the command line, as MRPT's SLAM programs take them.
#pragma once

#include <string>
#include <vector>

namespace vio::app {

/// A configuration (NAME.ini), a rawlog (any other name), or both, in any order. Throws InputError
/// where there are two of a kind, or one is given already.
void sort_files(const std::vector<std::string>& files, std::string& config, std::string& rawlog);

}  // namespace vio::app
