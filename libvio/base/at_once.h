// Work on several threads.
#pragma once

#include <algorithm>
#include <exception>
#include <system_error>
#include <thread>
#include <vector>

namespace vio {

/// Calls work(k) for 0 <= k < count at the same time, work(0) on this thread; one after another
/// where the system gives no further threads. Once all have ended, throws what the first of them
/// threw.
template <typename Work>
void at_once(int count, const Work& work) {
    if (count == 1) return work(0);
    std::vector<std::exception_ptr> thrown(static_cast<size_t>(std::max(0, count)));
    const auto run = [&](int k) noexcept {
        try {
            work(k);
        } catch (...) {
            thrown[static_cast<size_t>(k)] = std::current_exception();
        }
    };
    {
        std::vector<std::jthread> others;
        others.reserve(thrown.size());
        int k = 1;
        try {
            for (; k < count; ++k) others.emplace_back([&run, k] { run(k); });
        } catch (const std::system_error&) {  // no thread to be had: those that are left, here
        }
        if (count > 0) run(0);
        for (; k < count; ++k) run(k);
    }
    for (const std::exception_ptr& reason : thrown)
        if (reason) std::rethrow_exception(reason);
}

}  // namespace vio
