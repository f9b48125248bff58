#include "libvio/base/at_once.h"

#include <gtest/gtest.h>

#include <array>
#include <stdexcept>

namespace vio {
namespace {

TEST(AtOnce, CallsEachOnce) {
    for (int count = 0; count <= 5; ++count) {
        std::array<int, 5> calls{};
        at_once(count, [&](int k) { ++calls[k]; });
        for (int k = 0; k < 5; ++k) EXPECT_EQ(calls[k], k < count ? 1 : 0) << count;
    }
}

TEST(AtOnce, ThrowsWhatAThreadThrewWhenAllHaveEnded) {
    for (const int culprit : {0, 2}) {
        std::array<int, 4> calls{};
        try {
            at_once(4, [&](int k) {
                ++calls[k];
                if (k >= culprit) throw std::runtime_error(std::to_string(k));
            });
            ADD_FAILURE() << "nothing thrown";
        } catch (const std::runtime_error& reason) {
            EXPECT_EQ(reason.what(), std::to_string(culprit));
        }
        for (const int called : calls) EXPECT_EQ(called, 1);
    }
}

}  // namespace
}  // namespace vio
