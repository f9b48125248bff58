// Start of the filter where the path cannot be known: nothing but rotation is seen, or nothing
// tells its scale.
#pragma once

#include <optional>
#include <vector>

#include "libvio/recursive/levelled.h"

namespace vio {

/// Gyro bias from images that rotation alone explains: the features' rays between images that have
/// at least half of their features in common, turned as the gyro says. Nothing if the images show
/// parallax, or too few features for too short a time.
std::optional<GyroBias> gyro_bias_of_rotation(const std::vector<FeatureFrame>& frames,
                                              const ImuSequence& imu, const Rig& rig,
                                              double sigma_px);

/// What can be known without a path: attitude and biases.
struct AttitudeStart {
    std::vector<StateEstimate> states;  ///< at the images, lost
    BatchTail tail;                     ///< at the last image, with no points
};

/// Attitude by the gyro; its tilt from the mean specific force, which is gravity's but for the
/// change of velocity over the time that the images span; no velocity. Yaw and position are zero at
/// the first image: here W begins. The readings must span the images.
AttitudeStart start_of_attitude(const std::vector<FeatureFrame>& frames, const ImuSequence& imu,
                                const GyroBias& gyro, const Rig& rig, const BatchOptions& priors);

}  // namespace vio
