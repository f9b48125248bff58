// Everything that can be told of a recording before its motion is estimated.
#pragma once

#include <vector>

#include "libvio/check/finding.h"
#include "libvio/check/image_quality.h"
#include "libvio/check/image_rotations.h"
#include "libvio/io/recording.h"

namespace vio {

/// Collects a recording's messages and the tracks of its images, and judges them. Keeps all
/// readings and one image's features in ImageRotations::kSpacing.
class RecordingCheck {
 public:
    /// with_imu: readings are expected.
    RecordingCheck(const Rig& rig, bool with_imu) : rig_(rig), with_imu_(with_imu) {}

    /// In order of the file. Features that a recording holds in place of images count as its
    /// images, and go to add_tracks() too.
    void add(const Message& message);
    /// In order of time.
    void add_tracks(const FeatureFrame& frame);

    /// One finding a quantity, in an order to be read in. most_pairs: of images, whose rotation is
    /// compared with the gyro's (some milliseconds each).
    std::vector<Finding> findings(int most_pairs = 400) const;

 private:
    std::vector<ImuReading> readings_in_order() const;

    Rig rig_;
    bool with_imu_;
    std::vector<ImuReading> readings_;     // in order of the file
    std::vector<TimeNs> images_, frames_;  // likewise
    ImageQuality quality_;
    TrackQuality tracks_;
    ImageRotations rotations_;
};

/// The worst of them.
Grade worst(const std::vector<Finding>& findings);

}  // namespace vio
