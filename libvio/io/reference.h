// What a result is compared with: a trajectory as text, the odometry or GPS of a rawlog, or another
// result.
#pragma once

#include <Eigen/Dense>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "libvio/geometry/pose.h"

namespace vio {

/// Motion known from elsewhere.
struct Reference {
    std::string name;              ///< as it was asked for
    std::vector<TimedPose> poses;  ///< T_G_T of what is tracked, in order of time
    bool has_attitude = true;      ///< false: rotations are the identity and mean nothing
    bool has_scale = true;         ///< false: of a result from images alone
    bool is_exact = true;          ///< false: odometry or an estimate, which err as the result does
    bool is_file = false;          ///< a trajectory file, which does not say what it tracks
    Pose T_B_T;                    ///< pose of what is tracked, in the body frame
    std::vector<std::string> notes;
};

/// Which GPS fixes count, and where the antenna is.
struct ReferenceOptions {
    /// GGA qualities of the fixes that are taken. Empty: all but 0 (none) and 6 (dead reckoning).
    std::set<int> gps_qualities;
    /// Antenna in the body frame [m]; otherwise the observation's own sensorPose.
    std::optional<Eigen::Vector3d> gps_lever_arm;
};

/// Reads a trajectory in any layout of read_trajectory(), the path of a results folder, or from a
/// rawlog, asked for as `FILE.rawlog:odometry` (CObservationOdometry, or the odometry increments of
/// actions) or `FILE.rawlog:gps` (CObservationGPS with GGA message: WGS84 to east, north, up about
/// the first fix that is taken). Of several sources of the kind, the one that comes first is taken
/// and the notes name the others; `FILE.rawlog:gps:LABEL` asks for one by its sensor label. Throws
/// InputError (file, place) for a missing or damaged file, a rawlog that holds nothing of the kind,
/// and stamps that run backwards; repeated stamps are passed over and told in the notes.
Reference read_reference(const std::string& source, const ReferenceOptions& options = {});

}  // namespace vio
