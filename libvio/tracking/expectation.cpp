#include "libvio/tracking/expectation.h"

#include <algorithm>
#include <map>
#include <utility>

#include "libvio/base/median.h"

namespace vio {
namespace {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;

constexpr double kFar = 1e3;  // [m]: rotation alone moves what is as far as this
// A prediction less certain than this is of no use; that of a certain one is wrong by this much.
constexpr double kWidest_px = 8, kSight_px = 1;

// As far points move.
Expectation turned(const Track& track, const Camera& camera,
                   const std::optional<Matrix3d>& R_C1_C2) {
    const Expectation same{track.uv, track.A, track.uv};
    if (!R_C1_C2) return same;
    const auto place = [&](const Vector2d& uv) -> std::optional<Vector2d> {
        const auto ray = camera.ray(uv);
        if (!ray) return std::nullopt;
        return camera.project(R_C1_C2->transpose() * (kFar * ray->direction));
    };
    constexpr double kStep_px = 2;
    const auto uv = place(track.uv);
    const auto right = place(track.uv + Vector2d(kStep_px, 0));
    const auto down = place(track.uv + Vector2d(0, kStep_px));
    if (!uv || !right || !down) return same;
    Matrix2d turn;
    turn << (*right - *uv) / kStep_px, (*down - *uv) / kStep_px;
    return {*uv, turn * track.A, *uv};
}

}  // namespace

void expect(std::vector<Track>& tracks, const Camera& camera,
            const std::optional<Matrix3d>& R_C1_C2, double dt,
            const std::vector<PredictedFeature>& predicted) {
    std::vector<std::size_t> known;
    for (std::size_t i = 0; i < tracks.size(); ++i) {
        tracks[i].expected = turned(tracks[i], camera, R_C1_C2);
        if (tracks[i].parallax) known.push_back(i);
    }
    // As near points move.
    std::vector<Vector2d> rates;
    for (const Track& track : tracks)
        rates.push_back(track.parallax.value_or(nearest_median(
            tracks, track.expected.uv, known, [](const Track& other) { return *other.parallax; })));
    for (std::size_t i = 0; i < tracks.size(); ++i) tracks[i].expected.uv += dt * rates[i];

    std::map<FeatureId, Track*> by_id;
    if (!predicted.empty())
        for (Track& track : tracks) by_id[track.id] = &track;
    for (const PredictedFeature& feature : predicted) {
        const auto track = by_id.find(feature.id);
        if (track == by_id.end()) continue;
        if (!(feature.covariance.trace() < 2 * kWidest_px * kWidest_px)) continue;
        track->second->expected.uv = feature.uv_px;
        track->second->expected.region =
            feature.covariance + kSight_px * kSight_px * Matrix2d::Identity();
    }
}

Vector2d nearest_median(const std::vector<Track>& tracks, const Vector2d& uv,
                        const std::vector<std::size_t>& of,
                        const std::function<Vector2d(const Track&)>& value) {
    constexpr std::size_t kNeighbours = 7;
    std::vector<std::pair<double, std::size_t>> near;
    for (const std::size_t i : of) near.emplace_back((tracks[i].expected.uv - uv).squaredNorm(), i);
    const std::size_t n = std::min(kNeighbours, near.size());
    if (n == 0) return Vector2d::Zero();
    std::partial_sort(near.begin(), near.begin() + static_cast<std::ptrdiff_t>(n), near.end());
    Vector2d result;
    for (const int axis : {0, 1}) {
        std::vector<double> values;
        for (std::size_t k = 0; k < n; ++k) values.push_back(value(tracks[near[k].second])[axis]);
        result[axis] = median(std::move(values));
    }
    return result;
}

}  // namespace vio
