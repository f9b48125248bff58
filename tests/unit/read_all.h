// The messages of one kind in a rawlog.
#pragma once

#include <string>
#include <vector>

#include "libvio/io/recording.h"

namespace vio::test {

template <typename Type>
std::vector<Type> read_all(const std::string& rawlog) {
    Recording recording(rawlog);
    std::vector<Type> all;
    while (const auto message = recording.next())
        if (const auto* m = std::get_if<Type>(&*message)) all.push_back(*m);
    return all;
}

}  // namespace vio::test
