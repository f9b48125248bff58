// A recorded path and the inertial readings that were taken along it.
#pragma once

#include <string>
#include <vector>

#include "libvio/base/estimate.h"
#include "libvio/camera/rig.h"
#include "libvio/imu/integration.h"
#include "libvio/simulation/trajectory.h"

namespace vio {

/// Errors of the recorded poses, which vary slowly: 1 sigma per axis at each pose that is asked
/// for.
struct RecordedPathErrors {
    double rotation = 0.01;   ///< [rad]
    double position = 0.005;  ///< [m]
};

/// A recorded path moved, within its errors, to where the inertial readings agree with it.
struct SmoothedPath {
    std::vector<StateEstimate> states;  ///< of the body at the times asked for; W's z axis is up
    double rotation_rms = 0;            ///< how far the attitudes were moved [rad]
    double position_rms = 0;            ///< how far the positions were moved [m]
    double tilt = 0;                    ///< of the recording's frame against gravity [rad]
    int iterations = 0;
};

/// Most likely motion given recorded poses, readings and the noise of both: recorded poses agree
/// with the gyro to 0.1 degree or so, which is ten times its noise and would pass for an error of
/// any estimator that is judged by them. Biases walk from time to time. The frame is turned about
/// its origin so that gravity is along -z.
///
/// Method: Gauss-Newton on the residuals of PreintegratedImu, the biases' steps and the poses.
/// Throws InputError where the readings do not cover the times (shifted by rig.time_offset), or if
/// the iteration does not converge.
SmoothedPath smooth_path(const Trajectory& recorded, double t0_s, const std::vector<TimeNs>& times,
                         const ImuSequence& imu, const Rig& rig, double gravity,
                         const RecordedPathErrors& errors);

/// How well readings carry true states over windows of one length.
struct ImuConsistency {
    double window = 0;  ///< [s]
    int windows = 0;
    /// Mean of r^T C^-1 r / 9 over the windows, r the residual of PreintegratedImu and C its
    /// covariance, with the biases of the window's start: 1 if the readings' errors are as stated
    /// and the window is so short that the biases do not walk.
    double nees = 0;
    double rotation_rms = 0, position_rms = 0, velocity_rms = 0;  ///< of r: [rad], [m], [m/s]
};

/// One result for each number of images in `strides`, from non-overlapping windows.
std::vector<ImuConsistency> imu_consistency(const std::vector<StateEstimate>& truth,
                                            const ImuSequence& imu, const Rig& rig,
                                            const Eigen::Vector3d& g_W,
                                            const std::vector<int>& strides);

}  // namespace vio
