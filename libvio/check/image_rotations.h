// How the camera turned between images, from their features alone.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "libvio/base/types.h"
#include "libvio/camera/camera.h"
#include "libvio/check/angular_scale.h"

namespace vio {

/// Rotation of the camera between two images.
struct ImageRotation {
    TimeNs t1 = 0, t2 = 0;
    Eigen::Vector3d rotation = Eigen::Vector3d::Zero();  ///< log(R_C1_C2) [rad]
    /// Of its right perturbation, as far as the two images tell [rad^2].
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
};

/// Keeps one image in kSpacing seconds of those that it is given.
class ImageRotations {
 public:
    static constexpr double kSpacing = 0.1;  ///< [s]

    /// In order of time.
    void add(const FeatureFrame& frame);

    /// Rotations between neighbouring images of those kept, from pairs alone. Before a plane or
    /// with little parallax some fall into a wrong minimum. Pairs with too few features, or whose
    /// features do not agree on one motion, give nothing. Of more than `most` pairs, some, evenly
    /// chosen in stretches.
    std::vector<ImageRotation> from_pairs(const Camera& camera, int most) const;

    /// R_C1_C2 between the images at t1 and t2, about.
    using Prediction = std::function<std::optional<Eigen::Matrix3d>(TimeNs t1, TimeNs t2)>;
    /// The same from stretches of ten images that are adjusted together (RigidWindow), started as
    /// predicted: a second of motion tells a turn from a shift where two images hardly do.
    std::vector<ImageRotation> from_stretches(const Camera& camera, int most,
                                              const Prediction& predict) const;

    /// Scale of the angles from the optical axis by which images about half a second apart agree
    /// best on motions. Nothing if too few of them agree on any.
    std::optional<AngularScale> angular_scale(const Camera& camera, int most) const;

 private:
    template <typename Work>
    void for_stretches(int most, Work work) const;

    std::vector<FeatureFrame> frames_;
};

}  // namespace vio
