#include "libvio/slam/ordered_messages.h"

#include <utility>

namespace vio {

bool OrderedMessages::add(const Message& message) {
    if (const auto* reading = std::get_if<ImuReading>(&message)) {
        queue_.add(*reading);
        return true;
    }
    if (!std::holds_alternative<ImageMessage>(message) &&
        !std::holds_alternative<FeatureFrame>(message))
        return false;
    const int late = queue_.late();
    queue_.add(TimedMessage{time_of(message) + time_offset_, message});
    late_images_ += queue_.late() - late;
    return true;
}

std::optional<Message> OrderedMessages::pop(bool at_end) {
    auto next = queue_.pop(at_end);
    if (!next) return std::nullopt;
    if (const auto* reading = std::get_if<ImuReading>(&*next)) return *reading;
    return std::move(std::get<TimedMessage>(*next).message);
}

}  // namespace vio
