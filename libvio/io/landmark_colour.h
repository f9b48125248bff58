// Colours of landmarks in files.
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "libvio/base/estimate.h"

namespace vio {

/// Blue where a landmark is well known, red where its standard deviation is a tenth of the
/// structure's median distance from W's origin or more.
class LandmarkColours {
 public:
    explicit LandmarkColours(const std::vector<LandmarkEstimate>& landmarks);
    /// The same from the distances of the landmarks from W's origin [m].
    explicit LandmarkColours(std::vector<double> distances);
    Eigen::Vector3i rgb(const LandmarkEstimate& landmark) const;  ///< 0 to 255 each

 private:
    double scale_ = 1;  ///< median distance [m]
};

}  // namespace vio
