// The filter's first state from a joint estimate of a pose and the points in sight, section 5.2.
#pragma once

#include "libvio/batch/batch.h"
#include "libvio/recursive/motion.h"

namespace vio {

/// The camera's mount as far as it is known.
struct MountEstimate {
    CameraMount mount;
    Eigen::MatrixXd covariance;  ///< kMountSize square; empty: known exactly
    Eigen::MatrixXd with_tail;   ///< covariance of a tail's errors with its; empty: none
};

/// Which points the filter starts with, and its form.
struct FilterStartOptions {
    bool invariant = true;
    int max_landmarks = 50;
    double point_sigma =
        0.3;  ///< points whose distance is less certain than this share are left out
};

/// State at the time of the reading `at` (in the IMU frame, biased): the IMU's from that of the
/// body, with one clone (image 0) to which the most precise points are anchored. The tail is where
/// the body was when the image was taken, hence by the time offset's error away from that reading.
/// omega_I: angular velocity without bias [rad/s].
FilterState started(const BatchTail& tail, const MountEstimate& mount, const Rig& rig,
                    const MotionModel& motion, const ImuReading& at, const Eigen::Vector3d& omega_I,
                    const FilterStartOptions& options);

}  // namespace vio
