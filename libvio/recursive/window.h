// The window of cloned poses at work: points that are not (yet) in the state, section 5.5.
//
// A feature's sights from the window constrain its position x_l and the poses x:
//   r = H_x dx + H_l dl + n.
// The orthogonal factor of H_l splits them into three rows that determine dl and the rest, which is
// free of it. The rest is always used as an update (Mourikis and Roumeliotis 2007). The three rows
// make the point a landmark where it is precise enough: Smith, Self and Cheeseman's augmentation,
// Eqs. (24), (25), with the poses of all sights included in x, hence with the relative error of the
// recent cameras that the paper leaves out.
#pragma once

#include <map>
#include <optional>
#include <vector>

#include "libvio/recursive/filter_state.h"
#include "libvio/recursive/observation.h"

namespace vio {

/// How many points are used, and what they must satisfy.
struct WindowOptions {
    bool cameras_exact = false;  ///< new points as the paper does, recent cameras taken as exact
    int max_landmarks = 50;
    int max_points = 40;           ///< points used from the window at one image
    int min_sights = 4;            ///< of a point that becomes a landmark
    double new_point_sigma = 0.3;  ///< of inverse distance, as a share of what is usual
    double gate = 0.99;            ///< probability
    double angular_sigma = 1e-3;   ///< of a sight [rad]
};

/// Sights of features that are not landmarks, from the clones in the state.
class Window {
 public:
    Window(const WindowOptions& options, CameraPtr camera);

    /// Notes that a feature that is no landmark was seen at an image, of which there is a clone.
    void observe(FeatureId id, int image_idx, const Sight& sight);

    /// What an image's update from the window has used.
    struct Outcome {
        int used = 0, rejected = 0;  ///< points, new landmarks included
    };
    /// Uses the features whose tracks have ended, are precise enough to become landmarks, or are
    /// about to lose their oldest sight; updates and augments the state. leaving: image whose clone
    /// is about to be released, -1 if none.
    Outcome use(FilterState& state, int image_idx, int leaving);

    /// Forgets sights from a released clone.
    void forget_image(int image_idx);
    void clear() { tracks_.clear(); }

 private:
    // A sight, and the image (of a clone) that it is from.
    struct SightAt {
        int image_idx;
        Sight sight;
    };
    using Track = std::vector<SightAt>;

    // A track's sights from clones that there are, and the point that they alone give.
    struct Seen {
        std::vector<Pose> poses;
        std::vector<int> slots;
        std::vector<Sight> sights;
        AnchoredPoint point;  // anchored to the last
    };

    // A point with its rows split as above, at the point that the sights alone give.
    struct Split {
        FeatureId id = -1;
        int sights = 0;
        int anchor = -1;  // slot of the newest clone that saw it
        AnchoredPoint point;
        Eigen::Matrix3d covariance;  // of the point, poses taken as exact
        Eigen::Matrix3d R_l;         // upper triangular: R_l dl = -H_l_x dx - n
        Eigen::MatrixXd H_l_x;       // 3 rows; columns of mount and clones
        Eigen::MatrixXd H;           // free of the point; likewise
        Eigen::VectorXd residual;
    };

    std::optional<Seen> seen(const FilterState& state, const Track& track, double loss_width) const;
    std::optional<Track> agreeing(const FilterState& state, const Track& track) const;
    std::optional<Split> split(const FilterState& state, FeatureId id, const Track& track) const;
    bool passes_gate(const FilterState& state, const Split& point) const;
    bool precise(const Split& point, double usual_rho) const;
    void augment(FilterState& state, const std::vector<Split>& points) const;
    void update(FilterState& state, const std::vector<Split>& points) const;

    WindowOptions options_;
    CameraPtr camera_;
    std::map<FeatureId, Track> tracks_;
    std::vector<double> gates_;  // by degrees of freedom
};

}  // namespace vio
