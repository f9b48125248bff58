// Which images stand for the motion: key-frames.
#pragma once

#include <set>
#include <vector>

#include "libvio/base/types.h"

namespace vio {

/// Takes the first image of a sequence, and every one that shares less than `overlap` of the
/// features of the key-frame before.
class KeyframeSelector {
 public:
    explicit KeyframeSelector(double overlap = 0.6) : overlap_(overlap) {}

    /// Whether the image shows too little of the last key-frame.
    bool wants(const FeatureFrame& frame) const;
    /// Makes the image the last key-frame.
    void take(const FeatureFrame& frame);

 private:
    double overlap_;
    bool any_ = false;
    std::set<FeatureId> known_;
};

/// Indices of the key-frames of a whole sequence, the last image among them.
std::vector<int> select_keyframes(const std::vector<FeatureFrame>& frames, double overlap = 0.6);

}  // namespace vio
