#include "app/progress.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace vio::app {

Progress::Progress(std::string label)
    : label_(std::move(label)), on_terminal_(isatty(STDERR_FILENO) != 0) {}

Progress::~Progress() {
    if (drawn_permille_ >= 0) std::fputs("\r\033[K", stderr);
}

void Progress::update(double share) {
    if (!on_terminal_) return;
    const int permille = static_cast<int>(std::lround(1000 * std::clamp(share, 0.0, 1.0)));
    if (permille == drawn_permille_) return;
    drawn_permille_ = permille;
    constexpr int kWidth = 40;
    const int filled = permille * kWidth / 1000;
    std::fprintf(stderr, "\r%-10s [%s%s] %3d %%", label_.c_str(), std::string(filled, '=').c_str(),
                 std::string(kWidth - filled, ' ').c_str(), permille / 10);
    std::fflush(stderr);
}

}  // namespace vio::app
