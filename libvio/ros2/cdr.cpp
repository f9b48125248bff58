#include "libvio/ros2/cdr.h"

#include <utility>

namespace vio {

Cdr::Cdr(Bytes message, std::string place) : place_(std::move(place)) {
    if (message.size() < 4) throw error("the message is empty");
    if (message[0] != 0 || message[1] > 1) throw error("is not serialised as plain CDR");
    swapped_ = (message[1] == 1) != (std::endian::native == std::endian::little);
    content_ = message.subspan(4);
}

std::string_view Cdr::text() {
    const Bytes raw = bytes();
    // The count includes the zero at the end.
    const std::string_view all(reinterpret_cast<const char*>(raw.data()), raw.size());
    return all.substr(0, all.find('\0'));
}

Bytes Cdr::take(std::size_t count) {
    if (count > content_.size() - at_) throw error("the message is cut off");
    const Bytes taken = content_.subspan(at_, count);
    at_ += count;
    return taken;
}

}  // namespace vio
