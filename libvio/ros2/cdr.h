// Values in a message of ROS 2, serialised as CDR (OMG's DDS-RTPS 2.2, section 10).
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>

#include "libvio/io/left_out.h"

namespace vio {

using Bytes = std::span<const std::uint8_t>;

/// Reads a message's values one after the other; numbers are aligned to their size, counted from
/// the end of the four bytes that say the byte order. Every call throws UnusableMeasurement, with
/// the message's place, where the message ends before the value does.
class Cdr {
 public:
    /// `place`: of the message, for errors. Also throws if it is serialised in another way.
    Cdr(Bytes message, std::string place);

    template <typename Number>
    Number number() {
        align(sizeof(Number));
        const Bytes raw = take(sizeof(Number));
        std::array<std::uint8_t, sizeof(Number)> bytes;
        for (std::size_t i = 0; i < bytes.size(); ++i)
            bytes[i] = raw[swapped_ ? bytes.size() - 1 - i : i];
        return std::bit_cast<Number>(bytes);
    }
    template <std::size_t kCount>
    std::array<double, kCount> numbers() {
        std::array<double, kCount> all;
        for (double& value : all) value = number<double>();
        return all;
    }
    std::string_view text();
    /// sequence<uint8>
    Bytes bytes() { return take(number<std::uint32_t>()); }

    UnusableMeasurement error(const std::string& problem) const {
        return UnusableMeasurement(place_ + ": " + problem);
    }

 private:
    void align(std::size_t size) { take((size - at_ % size) % size); }
    Bytes take(std::size_t count);

    Bytes content_;  // without the first four bytes
    std::size_t at_ = 0;
    bool swapped_ = false;
    std::string place_;
};

}  // namespace vio
