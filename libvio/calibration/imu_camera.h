// Where a camera sits on an IMU, and how their clocks differ, from a recording of known points in
// motion.
#pragma once

#include "libvio/calibration/rig_calibration.h"

namespace vio {

/// What is found beside T_I_C, and how.
struct ImuCameraOptions {
    int intrinsics = 0;            ///< of RigQuestion; found too, where not 0
    double largest_offset = 0.25;  ///< that is searched about the rig's time offset [s]
    BatchOptions batch;            ///< its sigma_px 0: from the residuals

    ImuCameraOptions() { batch.sigma_px = 0; }
};

/// Finds T_I_C, the time offset and, if asked for, intrinsics, with covariance. The camera's
/// rotation against the IMU and a first offset come from the turns of both, so that the rig's own
/// need not be near; the rig's position of the camera is where the search for it starts.
/// problem.fiducials are the known points. Throws InputError where too few images show them, or
/// the camera hardly turns, or as calibrate_rig() does.
RigCalibration calibrate_imu_camera(const BatchProblem& problem,
                                    const ImuCameraOptions& options = {});

}  // namespace vio
