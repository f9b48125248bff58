// The camera of a scenario, of any model.
#pragma once

#include <string>
#include <vector>

#include "libvio/base/options.h"
#include "libvio/camera/camera.h"

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
    std::string mirror_pose = "0 0 0 0 0 0";

    void describe(OptionSet& options);
    /// Throws InputError where the values make no camera.
    CameraPtr make(int width, int height, const std::vector<double>& intrinsics,
                   const std::vector<double>& distortion) const;
};

}  // namespace vio
