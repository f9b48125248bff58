#include "libvio/tracking/tracker.h"

namespace vio {

void TrackerOptions::describe(OptionSet& options) {
    options.section("tracker");
    options.add("max_features", &max_features, "", {8, 5000}, "features held in each image");
    options.add("min_distance_px", &min_distance_px, "px", {2, 500},
                "distance between a new feature and all others");
    options.add("corner_quality", &corner_quality, "", {1e-5, 1},
                "weakest corner, as a share of the image's strongest");
    options.add("window_px", &window_px, "px", {5, 101}, "side of the Lucas-Kanade window");
    options.add("pyramid_levels", &pyramid_levels, "", {1, 8}, "halvings of the image");
    options.add("patience", &patience, "images", {0, 100},
                "images that a feature may be missed in before its track ends");
    options.add("geometry_px", &geometry_px, "px", {0.1, 100},
                "largest error of a feature in the geometry of two images or of more");
    options.add("long_gap", &long_gap, "images", {0, 1000},
                "distance of the second geometric check (0: off)");
    options.add("window_images", &window_images, "images", {0, 300},
                "over which each feature must fit one point of a rigid scene (0: off)");
    options.add("two_views", &two_views,
                "end features that disagree with the geometry of two images");
    options.add("realign", &realign, "align each feature with its first appearance");
    options.add("renew_looks", &renew_looks,
                "renew the appearance of a feature that has grown or shrunk twofold");
    options.add("min_correlation", &min_correlation, "", {-1, 1},
                "smallest correlation with the first appearance");
    options.add("texture_covariance", &texture_covariance,
                "shape each feature's covariance by its texture");
    options.add("seed", &seed, "", {0, 2147483647}, "of the random sampling");
}

}  // namespace vio
