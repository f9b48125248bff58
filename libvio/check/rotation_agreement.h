// Whether the gyro and the images saw the same rotation.
//
// With y the camera's rotation between two images (from features, in C) and x the gyro's angular
// velocity integrated over the same time shifted by tau and carried into C by the calibration,
//   y = M x + c T + noise,  T time between the images,
// where M is the identity if calibration, axes and units are right, and c stems from the gyro's
// bias. The shift that leaves the least of y unexplained, whatever M, is the time offset: it is
// found without trust in the axes. M is then fitted as gain times rotation; this tells: a rotation
// - the extrinsics or axes are turned; a negative gain - a mirror image, an odd number of axes is
// negated; a factor - the unit; a factor across the optical axis only - the focal length.
#pragma once

#include <optional>
#include <vector>

#include "libvio/camera/rig.h"
#include "libvio/check/finding.h"
#include "libvio/check/image_rotations.h"

namespace vio {

/// How the images' rotations follow from the gyro's, with 1-sigma of each figure.
struct RotationAgreement {
    int pairs = 0;          ///< of images that took part, outliers left out
    double image_rate = 0;  ///< rms of the camera's angular velocity, from images [rad/s]
    double noise = 0;       ///< rms of what M and c leave of y, per component [rad]
    double explained = 0;   ///< share of y's squares that M x + c T explains
    int axes = 0;           ///< 0 to 3: directions about which the rotation R is known

    double offset = 0, offset_sigma = 0;              ///< tau, to be added to Rig::time_offset [s]
    double gain = 1, gain_sigma = 0;                  ///< of y over the gyro, its sign left out
    bool mirrored = false;                            ///< the gain is negative
    Eigen::Matrix3d R = Eigen::Matrix3d::Identity();  ///< M = gain R, or -gain R if mirrored
    double angle = 0, angle_sigma = 0;  ///< of R, about the axes about which it is known [rad]
    Eigen::Vector3d drift = Eigen::Vector3d::Zero();  ///< c [rad/s]
    /// Exchange of axes that M is but for its gain, if it is one: true = axes recorded, in the
    /// camera's frame and in the IMU's.
    std::optional<Eigen::Matrix3d> camera_axes, imu_axes;
    /// Gain across the optical axis over that along it (or over 1 where nothing turned along it):
    /// stated over true focal length.
    double focal_ratio = 1, focal_sigma = 0;
};

/// Looks for a time offset of up to `search` seconds. readings: in order of time, no stamp twice.
/// most_pairs: of images. Nothing if fewer than 15 of them lie within the readings. The rig has a
/// camera.
std::optional<RotationAgreement> compare_rotations(const ImageRotations& images,
                                                   const std::vector<ImuReading>& readings,
                                                   const Rig& rig, int most_pairs,
                                                   double search = 0.5);

/// Verdicts on it.
std::vector<Finding> check_rotations(const std::optional<RotationAgreement>& agreement,
                                     const Rig& rig);

}  // namespace vio
