// The camera of a scenario, of any model.
#pragma once

#include <string>
#include <vector>

#include "libvio/base/options.h"
#include "libvio/camera/camera.h"
#include "libvio/simulation/tracks.h"

namespace vio {

/// Keys of a scenario's section [camera] beyond size, intrinsics and distortion; which of them
/// matter depends on the model. Lists are text, numbers separated by blanks.
struct ScenarioCamera {
    std::string model = "perspective";
    double max_angle_deg = 180, min_angle_deg = 0;
    double xi = 0;
    bool mirror = false;
    double gain = 0, apex_distance = 0, eccentricity = 0, semi_latus_rectum = 0;
    double rim_radius = 0, blind_radius = 0;
    std::string mirror_pose = "0 0 0 0 0 0", stated_mirror_pose;
    double mirror_vibration = 0;  ///< [m]

    void describe(OptionSet& options);
    /// The camera as the rawlog's calibration has it: with stated_mirror_pose, if given.
    ScenarioCamera stated() const;
    /// Throws InputError where the values make no camera.
    CameraPtr make(int width, int height, const std::vector<double>& intrinsics,
                   const std::vector<double>& distortion) const;
    /// The camera at each image, where the mirror vibrates across its axis: by mirror_vibration,
    /// 1 sigma per axis, when the acceleration [m/s^2] has its root mean square, and in proportion
    /// at other times. Independent from image to image, as vibration much faster than the images.
    /// Empty without vibration. Throws InputError for a model that has no mirror to vibrate.
    std::vector<CameraPtr> vibrating(const CameraPtr& camera,
                                     const std::vector<double>& accelerations,
                                     Random& random) const;
};

/// Moves the tracks to where the cameras, one for each image, see their points.
void apply_vibration(const Camera& steady, const std::vector<CameraPtr>& vibrating,
                     const std::vector<Pose>& T_W_C, SimulatedTracks& tracks);

}  // namespace vio
