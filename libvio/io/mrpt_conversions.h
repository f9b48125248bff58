// Between the library's types and MRPT's. Every conversion exists once, here.
#pragma once

#include <mrpt/core/Clock.h>
#include <mrpt/img/TCamera.h>
#include <mrpt/obs/CAction.h>
#include <mrpt/obs/CObservationGPS.h>
#include <mrpt/obs/CObservationIMU.h>
#include <mrpt/poses/CPose3D.h>
#include <mrpt/poses/CPose3DPDFGaussian.h>

#include <optional>

#include "libvio/camera/camera.h"
#include "libvio/geometry/pose.h"
#include "libvio/io/feature_observation.h"
#include "libvio/io/recording.h"

namespace vio {

/// Stamp in MRPT's ticks of 100 ns, rounded down.
mrpt::Clock::time_point to_mrpt(TimeNs t);
/// Exact.
TimeNs from_mrpt(mrpt::Clock::time_point t);

mrpt::poses::CPose3D to_mrpt(const Pose& T);
Pose from_mrpt(const mrpt::poses::CPose3D& T);

/// d (x, y, z, yaw, pitch, roll) / d (rotation, translation), the project's tangent of Pose:
/// with p pitch and r roll, d (yaw, pitch, roll) / d rotation =
///   [0 sin r/cos p  cos r/cos p; 0 cos r -sin r; 1 sin r tan p  cos r tan p].
/// Grows without bound towards gimbal lock (p = +-pi/2), as MRPT's angles do.
Matrix6d mrpt_tangent_jacobian(const Pose& T);

/// Pose with covariance in the project's order (rotation perturbed on the right, translation in the
/// outer frame) as MRPT's (x, y, z, yaw, pitch, roll), and back.
mrpt::poses::CPose3DPDFGaussian to_mrpt(const Pose& T, const Matrix6d& covariance);
/// A pose and its covariance in the tangent order, from MRPT's.
struct PoseWithCovariance {
    Pose pose;
    Matrix6d covariance;  ///< (rotation, translation)
};
PoseWithCovariance from_mrpt(const mrpt::poses::CPose3DPDFGaussian& pdf);

/// Intrinsics. To: all of a camera that fits_mrpt(); of others the image size and the model's name,
/// for model_elsewhere(). No camera gives zero intrinsics. From: null if not calibrated (zero focal
/// length or size).
mrpt::img::TCamera to_mrpt(const CameraPtr& camera);
CameraPtr from_mrpt(const mrpt::img::TCamera& camera);
/// True if MRPT's camera holds all of this one: perspective, or fisheye without a limit of its
/// field.
bool fits_mrpt(const Camera& camera);
/// Model of a camera that did not fit: its calibration is in a file. Empty otherwise.
std::string model_elsewhere(const mrpt::img::TCamera& camera);

/// Reading of gyro and accelerometer. MRPT indexes angular rates z, y, x and accelerations x, y, z.
/// From: nothing if the observation lacks one of the six.
mrpt::obs::CObservationIMU to_mrpt(const ImuReading& reading);
std::optional<ImuReading> from_mrpt(const mrpt::obs::CObservationIMU& observation);

/// Fix as an NMEA GGA message. From: nothing if the observation holds no GGA message.
mrpt::obs::CObservationGPS to_mrpt(const GpsMessage& fix);
std::optional<GpsMessage> from_mrpt(const mrpt::obs::CObservationGPS& observation);

/// Odometry increment of MRPT's older rawlog layout; nothing for other actions.
std::optional<Pose> odometry_increment(const mrpt::obs::CAction& action);

/// Features with their stamp; label and calibration are the caller's to add.
CObservationFeatures to_mrpt(const FeatureFrame& frame);
FeatureFrame from_mrpt(const CObservationFeatures& observation);

}  // namespace vio
