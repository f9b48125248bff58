// Where features are expected in a new image.
#pragma once

#include <Eigen/Dense>
#include <functional>
#include <optional>
#include <vector>

#include "libvio/camera/camera.h"
#include "libvio/tracking/predicted_feature.h"
#include "libvio/tracking/track.h"

namespace vio {

/// Sets what is expected of each track in an image dt [s] after the one that they were last
/// followed in: R_C1_C2, where known, turns the rays, and with them the shapes; beyond that each
/// goes on as it did, a new one as its neighbours did. Where an estimator tells better, that holds.
void expect(std::vector<Track>& tracks, const Camera& camera,
            const std::optional<Eigen::Matrix3d>& R_C1_C2, double dt,
            const std::vector<PredictedFeature>& predicted = {});

/// Median, for each coordinate, of a value over those of some tracks (`of`, by index) that are
/// expected nearest to uv; zero if there are none.
Eigen::Vector2d nearest_median(const std::vector<Track>& tracks, const Eigen::Vector2d& uv,
                               const std::vector<std::size_t>& of,
                               const std::function<Eigen::Vector2d(const Track&)>& value);

}  // namespace vio
