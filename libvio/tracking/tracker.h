// Feature tracks from images.
#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "libvio/base/options.h"
#include "libvio/base/types.h"
#include "libvio/camera/camera.h"
#include "libvio/tracking/predicted_feature.h"

namespace vio {

/// How features are found, followed and verified.
struct TrackerOptions {
    int max_features = 150;
    double min_distance_px = 15;    ///< between newly found features and all others
    double corner_quality = 0.01;   ///< weakest corner, as a share of the image's strongest [-]
    int window_px = 15;             ///< side of the window of Lucas and Kanade's method
    int pyramid_levels = 3;         ///< halvings of the image
    int patience = 3;               ///< images that a feature may be missed in
    double geometry_px = 1.2;       ///< largest error in the geometry of two images or of more
    int long_gap = 32;              ///< images between those of the second geometric check; 0: off
    int window_images = 30;         ///< over which features must fit a rigid scene; 0: off
    bool two_views = true;          ///< check the geometry of two images
    bool realign = true;            ///< align with the first appearance
    bool renew_looks = true;        ///< of features that have grown or shrunk much
    double min_correlation = 0.75;  ///< with the first appearance [-]
    bool texture_covariance = false;  ///< shape of the covariance from the texture
    int seed = 1;

    void describe(OptionSet& options);
};

/// What became of the features at one image, and what each step cost.
struct TrackerReport {
    bool blank = false;  ///< image without contrast (dark, lens cap): tracks wait for the next one
    int before = 0;      ///< features alive before the image
    int lost_flow = 0, lost_look = 0;      ///< not found by each step
    int found_again = 0;                   ///< of these, by searching
    int lost_geometry = 0;                 ///< found, but in disagreement with the motion
    int lost_window = 0;                   ///< in disagreement with the rigid scene
    std::vector<FeatureId> rejected = {};  ///< the features of lost_geometry and lost_window
    int ended = 0, ended_by_caller = 0, detected = 0, after = 0;
    double seconds_pyramid = 0, seconds_flow = 0, seconds_realign = 0, seconds_geometry = 0,
           seconds_detect = 0;
};

/// Follows features through a sequence of grey images of one camera. Equal input gives equal
/// output, whatever the number of threads.
class FeatureTracker {
 public:
    FeatureTracker(const TrackerOptions& options, CameraPtr camera);
    ~FeatureTracker();

    /// Features of the next image (8-bit grey, size of the camera). R_C1_C2 is the rotation of the
    /// camera since the previous image (p_C1 = R_C1_C2 p_C2 for far points), from the gyro, where
    /// known; it predicts where features have moved. predicted: where an estimator expects some of
    /// them; these are looked for in its ellipses only.
    /// Throws InputError for an image of another size or type, or a time that does not increase.
    FeatureFrame track(TimeNs t, const cv::Mat& image,
                       const std::optional<Eigen::Matrix3d>& R_C1_C2 = std::nullopt,
                       const std::vector<PredictedFeature>& predicted = {});

    /// Region of interest: 8-bit, size of the camera, zero where features are not wanted (vehicle
    /// parts, a mirror's blind spots). Throws InputError for another size or type.
    void set_mask(const cv::Mat& mask);

    /// Ends tracks that the caller found to be wrong (an estimator's innovation gate).
    void end_tracks(const std::vector<FeatureId>& ids);

    const TrackerReport& report() const;  ///< of the last image

 private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace vio
