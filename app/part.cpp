#include "app/part.h"

#include <algorithm>

#include "libvio/base/errors.h"
#include "libvio/check/finding.h"

namespace vio::app {

void add_part_options(CLI::App& command, PartRequest& part, const std::string& use) {
    command
        .add_option("--from", part.begin_s,
                    use + "Leave out what is before, counted from the first measurement [s]")
        ->check(CLI::NonNegativeNumber);
    command.add_option("--to", part.end_s, use + "Leave out what is after [s]")
        ->check(CLI::PositiveNumber);
}

void check(const PartRequest& part) {
    if (part.begin_s && !(*part.begin_s < part.end_s))
        throw InputError("--from and --to: nothing lies between them; --to is to be the later one");
}

bool Part::contains(const Message& message) {
    const TimeNs t = time_of(message);
    if (!begun_) origin_ = t;
    begun_ = true;
    const double seconds = to_seconds(t - origin_);
    last_ = std::max(last_, seconds);
    beyond_ = seconds > request_.end_s + window_ ? beyond_ + 1 : 0;
    const double margin = std::holds_alternative<ImuReading>(message) ? 0.1 : 0;
    if (request_.begin_s && seconds < -window_) {
        ++late_;
        late_images_ += std::holds_alternative<ImageMessage>(message) ||
                        std::holds_alternative<FeatureFrame>(message);
        return false;
    }
    const bool inside = (!request_.begin_s || seconds >= *request_.begin_s - margin) &&
                        seconds <= request_.end_s + margin;
    any_ = any_ || inside;
    return inside;
}

std::string Part::why_empty() const {
    if (any_) return "";
    const double begin = request_.begin_s.value_or(0);
    std::string why =
        last_ >= begin
            ? formatted("no measurement lies between --from %g and --to %g", begin, request_.end_s)
            : formatted("--from %g lies beyond the recording's %.1f s", begin, last_);
    if (late_ > 0) why += formatted("; %d messages are stamped before the file's first one", late_);
    return why;
}

}  // namespace vio::app
