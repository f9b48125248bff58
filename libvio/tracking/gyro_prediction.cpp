#include "libvio/tracking/gyro_prediction.h"

namespace vio {

std::optional<Eigen::Matrix3d> camera_rotation(const ImuSequence& imu, const Rig& rig, TimeNs t1,
                                               TimeNs t2, const Eigen::Vector3d& gyro_bias) {
    if (t2 < t1) return std::nullopt;
    const TimeNs offset = from_seconds(rig.time_offset);
    const auto segments = imu.segments(t1 + offset, t2 + offset);
    if (!segments) return std::nullopt;
    InertialState state;
    for (const ImuSegment& segment : *segments)
        integrate(state, {segment.dt, segment.gyro - gyro_bias, Eigen::Vector3d::Zero()},
                  Eigen::Vector3d::Zero());
    const Eigen::Matrix3d R_I_C = rig.T_I_C().R;
    return R_I_C.transpose() * state.R * R_I_C;
}

}  // namespace vio
