#include "libvio/io/left_out.h"

#include <algorithm>

namespace vio {

std::string one_line(const LeftOut& left_out) {
    return std::to_string(left_out.count) + " " + left_out.what +
           (left_out.count > 1 ? "; the first: " : ": ") + left_out.first;
}

void LeftOutList::add(const LeftOut& more) {
    const auto kind = std::find_if(kinds_.begin(), kinds_.end(),
                                   [&](const LeftOut& known) { return known.what == more.what; });
    if (kind == kinds_.end())
        kinds_.push_back(more);
    else
        kind->count += more.count;
}

void LeftOutList::add(const std::string& what, const std::string& reason) {
    add(LeftOut{what, 1, reason});
}

void LeftOutList::add(const LeftOutList& others) {
    for (const LeftOut& kind : others.kinds_) add(kind);
}

int LeftOutList::total() const {
    int total = 0;
    for (const LeftOut& kind : kinds_) total += kind.count;
    return total;
}

}  // namespace vio
