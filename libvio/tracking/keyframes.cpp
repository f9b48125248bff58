#include "libvio/tracking/keyframes.h"

#include <algorithm>

namespace vio {

bool KeyframeSelector::wants(const FeatureFrame& frame) const {
    if (!any_) return true;
    const auto shared =
        std::count_if(frame.features.begin(), frame.features.end(),
                      [&](const FeatureObservation& f) { return known_.count(f.feature_id); });
    return static_cast<double>(shared) < overlap_ * static_cast<double>(known_.size());
}

void KeyframeSelector::take(const FeatureFrame& frame) {
    any_ = true;
    known_.clear();
    for (const FeatureObservation& f : frame.features) known_.insert(f.feature_id);
}

std::vector<int> select_keyframes(const std::vector<FeatureFrame>& frames, double overlap) {
    std::vector<int> keyframes;
    KeyframeSelector selector(overlap);
    for (size_t i = 0; i < frames.size(); ++i) {
        if (!selector.wants(frames[i]) && i + 1 < frames.size()) continue;
        selector.take(frames[i]);
        keyframes.push_back(static_cast<int>(i));
    }
    return keyframes;
}

}  // namespace vio
