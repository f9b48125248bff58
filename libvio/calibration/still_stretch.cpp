#include "libvio/calibration/still_stretch.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "libvio/base/errors.h"
#include "libvio/base/median.h"
#include "libvio/io/text.h"

namespace vio {
namespace {

constexpr TimeNs kWindow = 1'000'000'000, kLeast = 60 * kWindow;
constexpr double kUnusual = 10;        // times the usual step between neighbouring windows
constexpr double kLargestRate = 0.02;  // of a window's mean from the median [rad/s]
constexpr double kLargestAccel = 0.3;  // likewise [m/s^2]
constexpr double kLeastTurn = 1e-3;    // of a step that counts, whatever is usual [rad/s]
constexpr double kLeastPush = 1e-2;    // likewise [m/s^2]
constexpr double kLargestGap = 3;      // intervals between readings

using Vector6 = Eigen::Matrix<double, 6, 1>;

// Mean of about a second.
struct Window {
    std::ptrdiff_t begin = 0, end = 0;
    Vector6 mean = Vector6::Zero();
    bool after_gap = false;
};

std::vector<Window> windows_of(const std::vector<ImuReading>& readings, TimeNs interval) {
    std::vector<Window> windows;
    Window w;
    const auto count = static_cast<std::ptrdiff_t>(readings.size());
    for (std::ptrdiff_t i = 0; i < count; ++i) {
        const ImuReading& reading = readings[static_cast<size_t>(i)];
        const TimeNs begin = readings[static_cast<size_t>(w.begin)].t;
        const TimeNs gap = i > 0 ? reading.t - readings[static_cast<size_t>(i - 1)].t : 0;
        const bool broken = static_cast<double>(gap) > kLargestGap * static_cast<double>(interval);
        if (broken || reading.t - begin >= kWindow) {
            w.end = i;
            w.mean /= static_cast<double>(w.end - w.begin);
            windows.push_back(w);
            w = {};
            w.begin = i;
            w.after_gap = broken;
        }
        w.mean.head<3>() += reading.gyro;
        w.mean.tail<3>() += reading.accel;
    }
    return windows;
}

// Whether a window is of a sensor at rest, judged by its mean alone and by the step from the window
// before.
class Judge {
 public:
    explicit Judge(const std::vector<Window>& windows) {
        for (int axis = 0; axis < 6; ++axis) {
            std::vector<double> means, steps;
            for (size_t i = 0; i < windows.size(); ++i) {
                means.push_back(windows[i].mean(axis));
                if (i > 0)
                    steps.push_back(std::abs(windows[i].mean(axis) - windows[i - 1].mean(axis)));
            }
            median_(axis) = median(means);
            // Of |x| with x normal, the median is 0.6745 sigma.
            step_(axis) =
                std::max(kUnusual * median(steps) / 0.6745, axis < 3 ? kLeastTurn : kLeastPush);
        }
    }

    bool moved(const Window& w) const {
        const Vector6 d = (w.mean - median_).cwiseAbs();
        return d.head<3>().maxCoeff() > kLargestRate || d.tail<3>().maxCoeff() > kLargestAccel;
    }
    bool jumped(const Window& a, const Window& b) const {
        return ((a.mean - b.mean).cwiseAbs() - step_).maxCoeff() > 0;
    }

 private:
    Vector6 median_, step_;
};

TimeNs median_interval(const std::vector<ImuReading>& readings) {
    std::vector<double> intervals;
    for (size_t i = 1; i < readings.size(); ++i)
        intervals.push_back(static_cast<double>(readings[i].t - readings[i - 1].t));
    return static_cast<TimeNs>(median(intervals));
}

}  // namespace

StillStretch longest_still_stretch(const std::vector<ImuReading>& readings) {
    if (readings.size() < 2 || readings.back().t - readings.front().t < kLeast)
        throw InputError("the recording is shorter than a minute; record hours at rest");
    const auto windows = windows_of(readings, median_interval(readings));
    if (windows.size() < 3) throw InputError("the readings are less than one a second");
    const Judge judge(windows);
    StillStretch best, current;
    int moved = 0, gaps = 0;
    const auto duration = [&](const StillStretch& s) {
        return s.end > s.begin ? readings[static_cast<size_t>(s.end - 1)].t -
                                     readings[static_cast<size_t>(s.begin)].t
                               : 0;
    };
    for (size_t i = 0; i < windows.size(); ++i) {
        const Window& w = windows[i];
        const bool moving = judge.moved(w);
        const bool broken = w.after_gap || (i > 0 && judge.jumped(windows[i - 1], w));
        gaps += w.after_gap;
        moved += moving || (broken && !w.after_gap);
        if (broken || moving) current = {moving ? w.end : w.begin, 0, {}};
        if (!moving) current.end = w.end;
        if (duration(current) > duration(best)) best = current;
    }
    if (duration(best) < kLeast)
        throw InputError(
            "no minute at rest; lay the IMU on something that does not shake and record for hours");
    if (gaps > 0) best.warnings.push_back(std::to_string(gaps) + " gaps in the readings");
    if (moved > 0)
        best.warnings.push_back("the IMU moved, or jumped, in " + std::to_string(moved) + " of " +
                                std::to_string(windows.size()) + " seconds");
    if (!best.warnings.empty())
        best.warnings.push_back(
            "only the longest stretch without these is used: " +
            std::to_string(std::lround(to_seconds(duration(best)))) + " s from " +
            format_seconds(readings[static_cast<size_t>(best.begin)].t) + " s on");
    return best;
}

}  // namespace vio
