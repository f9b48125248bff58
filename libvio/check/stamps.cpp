#include "libvio/check/stamps.h"

#include <algorithm>
#include <cmath>

#include "libvio/base/median.h"

namespace vio {
namespace {

// Readings: the filter's bridges over a gap hold for some hundredths of a second; what happens in
// half a second cannot be guessed.
constexpr double kSlowestImu = 50, kFastestImu = 5000;       // [Hz]
constexpr double kShortGap = 0.03, kLongGap = 0.5;           // [s]
constexpr double kMostJitter = 0.2;                          // of the interval
constexpr double kSlowestCamera = 1, kFastestCamera = 1000;  // [Hz]
constexpr double kMostDropped = 0.02, kFarTooManyDropped = 0.2;
constexpr double kLongImageGap = 2;     // [s]
constexpr double kLargestStepBack = 1;  // [s]
constexpr double kMostRepeated = 0.1;

double share(int part, int whole) {
    return whole > 0 ? static_cast<double>(part) / whole : 0;
}

Finding rate(const std::string& stream, const StampStatistics& s, double slowest, double fastest) {
    Finding f{Grade::ok, stream + " rate", formatted("%.2f Hz over %.2f s", s.rate(), s.duration()),
              formatted("%g to %g Hz", slowest, fastest), ""};
    if (s.rate() < slowest) {
        f.grade = Grade::warning;
        f.advice = "too slow to follow fast motion; record at a higher rate";
    }
    if (s.count < 2 || s.rate() > fastest) {
        f.grade = Grade::error;
        f.advice = s.count < 2 ? "hardly any data; see whether the sensor was recorded"
                               : "no such sensor; see in which unit the time stamps were written";
    }
    return f;
}

Finding jitter(const std::string& stream, const StampStatistics& s) {
    const double relative = s.median_interval > 0 ? s.jitter / to_seconds(s.median_interval) : 0;
    Finding f{Grade::ok, stream + " jitter",
              formatted("%.3f ms rms, %.1f %% of the interval", 1e3 * s.jitter, 1e2 * relative),
              formatted("at most %g %%", 1e2 * kMostJitter), ""};
    if (relative > kMostJitter) {
        f.grade = Grade::warning;
        f.advice = "stamps look like times of arrival; use the sensor's own clock";
    }
    return f;
}

Finding order(const std::string& stream, const StampStatistics& s) {
    Finding f{Grade::ok, stream + " order",
              formatted("%d repeated stamps, %d steps back", s.repeated, s.backward), "none", ""};
    if (s.backward > 0)
        f.measured += formatted(", largest %.4f s", to_seconds(s.largest_step_back));
    if (s.repeated > 0 || s.backward > 0) {
        f.grade = Grade::warning;
        f.advice =
            "repeated ones are left out, late ones put in order up to "
            "iekf.message_window; see how the recording was made";
    }
    if (to_seconds(s.largest_step_back) > kLargestStepBack ||
        share(s.repeated, s.count) > kMostRepeated) {
        f.grade = Grade::error;
        f.advice =
            "time goes backwards or data are there twice: recordings joined, or a clock "
            "that was set; cut the recording there";
    }
    return f;
}

std::string gap_text(const StampStatistics& s) {
    std::string out = formatted("%d gaps, %d missing", s.gaps, s.missing);
    if (s.gaps > 0)
        out += formatted(", longest interval %.4f s after %.3f s", to_seconds(s.largest_gap),
                         to_seconds(s.largest_gap_at - s.first));
    return out;
}

}  // namespace

StampStatistics stamp_statistics(const std::vector<TimeNs>& stamps) {
    StampStatistics s;
    s.count = static_cast<int>(stamps.size());
    if (stamps.empty()) return s;
    for (std::size_t i = 1; i < stamps.size(); ++i) {
        if (stamps[i] >= stamps[i - 1]) continue;
        ++s.backward;
        s.largest_step_back = std::max(s.largest_step_back, stamps[i - 1] - stamps[i]);
    }
    std::vector<TimeNs> sorted = stamps;
    std::sort(sorted.begin(), sorted.end());
    sorted.erase(std::unique(sorted.begin(), sorted.end()), sorted.end());
    s.repeated = s.count - static_cast<int>(sorted.size());
    s.first = sorted.front();
    s.last = sorted.back();
    if (sorted.size() < 2) return s;
    std::vector<TimeNs> intervals;
    for (std::size_t i = 1; i < sorted.size(); ++i) intervals.push_back(sorted[i] - sorted[i - 1]);
    s.median_interval = median(intervals);
    double squares = 0;
    int regular = 0;
    for (std::size_t i = 0; i < intervals.size(); ++i) {
        if (intervals[i] > s.largest_gap) {
            s.largest_gap = intervals[i];
            s.largest_gap_at = sorted[i];
        }
        const double intervals_long =
            static_cast<double>(intervals[i]) / static_cast<double>(s.median_interval);
        if (intervals_long > StampStatistics::kGap) {
            ++s.gaps;
            s.missing += static_cast<int>(std::min(std::round(intervals_long) - 1, 1e9));
        } else {
            const double deviation = to_seconds(intervals[i] - s.median_interval);
            squares += deviation * deviation;
            ++regular;
        }
    }
    s.jitter = std::sqrt(squares / std::max(1, regular));
    return s;
}

std::vector<Finding> check_imu_stamps(const StampStatistics& imu) {
    const double longest = to_seconds(imu.largest_gap);
    Finding gaps{Grade::ok, "IMU gaps", gap_text(imu), formatted("none above %g s", kShortGap), ""};
    if (imu.gaps > 0 && longest > kShortGap) {
        gaps.grade = longest > kLongGap ? Grade::error : Grade::warning;
        gaps.advice = longest > kLongGap
                          ? "the motion in between is lost; use the parts before and after "
                            "(--from, --to) or record again"
                          : "readings were lost; see the driver's queue and the disk";
    }
    return {rate("IMU", imu, kSlowestImu, kFastestImu), gaps, jitter("IMU", imu),
            order("IMU", imu)};
}

std::vector<Finding> check_image_stamps(const StampStatistics& images) {
    const double dropped = share(images.missing, images.missing + images.count);
    Finding gaps{Grade::ok, "image gaps", gap_text(images) + formatted(", %.1f %%", 1e2 * dropped),
                 formatted("at most %g %% missing", 1e2 * kMostDropped), ""};
    if (dropped > kMostDropped) {
        gaps.grade = Grade::warning;
        gaps.advice = "frames were dropped; see the camera's bandwidth and the disk";
    }
    if (dropped > kFarTooManyDropped || to_seconds(images.largest_gap) > kLongImageGap) {
        gaps.grade = Grade::error;
        gaps.advice =
            "features do not last over such gaps; record again, or use the parts before "
            "and after (--from, --to)";
    }
    return {rate("image", images, kSlowestCamera, kFastestCamera), gaps, order("image", images)};
}

Finding check_overlap(const StampStatistics& imu, const StampStatistics& images,
                      double time_offset) {
    const TimeNs offset = from_seconds(time_offset);
    const double common = to_seconds(std::min(imu.last, images.last + offset) -
                                     std::max(imu.first, images.first + offset));
    const double covered =
        images.duration() > 0 ? std::clamp(common / images.duration(), 0.0, 1.0) : common >= 0;
    Finding f{Grade::ok, "common time",
              formatted("readings cover %.1f %% of the images' time", 1e2 * covered),
              "at least 95 %", ""};
    if (covered < 0.95) {
        f.grade = Grade::warning;
        f.advice = "images outside the readings are left out; start the IMU first";
    }
    if (covered < 0.5) {
        f.grade = Grade::error;
        f.advice =
            formatted("camera and IMU start %.3f s apart: do their stamps come from one clock?",
                      to_seconds(images.first + offset - imu.first));
    }
    return f;
}

}  // namespace vio
