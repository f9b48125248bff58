// Feature tracks with known truth, without images.
#pragma once

#include <functional>
#include <map>
#include <vector>

#include "libvio/base/options.h"
#include "libvio/base/types.h"
#include "libvio/camera/camera.h"
#include "libvio/geometry/pose.h"
#include "libvio/simulation/random.h"
#include "libvio/simulation/scene.h"

namespace vio {

/// How a simulated tracker behaves.
struct TrackModel {
    int most = 60;           ///< features after extraction
    int fewest = 50;         ///< with fewer in sight, new ones are extracted
    double spacing_px = 15;  ///< least distance of a new feature to the others [px]
    double border_px = 5;    ///< features this near the image's edge are lost [px]
    double noise_px = 1;     ///< isotropic standard deviation of each observation [px]
    double drift_px = 0;     ///< random walk of the tracked place, per image and axis [px]
    double loss_rate = 0;    ///< probability to lose a feature, per image
    bool refind = false;     ///< lost features that are in sight again are taken up before new ones
    double lasting = 0;      ///< least share of all images in which a picked feature is in sight
    int longest = 0;         ///< images after which a feature is lost; 0: no limit
    /// Probability, per observation, that the tracker jumps to another place of the surface, and
    /// follows that from then on.
    double mistrack_rate = 0;
    double mistrack_px = 30;  ///< standard deviation of such a jump, per axis [px]
    /// Probability, per observation, that this one is off; the next is right again.
    double outlier_rate = 0;
    double outlier_px = 30;  ///< standard deviation of that, per axis [px]

    /// Adds its keys to the set's present section.
    void describe(OptionSet& options);
};

/// Features as a tracker would give them, and the truth about them.
struct SimulatedTracks {
    std::vector<FeatureFrame> frames;               ///< one per image
    std::map<FeatureId, Eigen::Vector3d> points_W;  ///< the points that were picked [m]
    std::vector<FeatureId> mistracked;              ///< features that jumped, in order of time
};

/// Tracks points of the scene's surfaces through images taken at `times` from T_W_C. A point is
/// seen while it projects into the image and nothing stands before it (ray cast). Points are picked
/// through the camera, evenly over the image.
SimulatedTracks simulate_tracks(const Scene& scene, const Camera& camera,
                                const std::vector<TimeNs>& times, const std::vector<Pose>& T_W_C,
                                const TrackModel& model, Random& random);

}  // namespace vio
