#include "libvio/tracking/follower.h"

#include <cmath>
#include <opencv2/video/tracking.hpp>

#include "libvio/tracking/expectation.h"

namespace vio {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

constexpr double kMostStretch = 2;  // of a look, before it is renewed
constexpr double kSearch_px2 = 4;   // variance of where a missed feature is expected
constexpr double kRegion2 = 9;      // squared Mahalanobis distance of an ellipse's edge

std::vector<cv::Point2f> to_points(const std::vector<Vector2d>& places) {
    std::vector<cv::Point2f> points;
    points.reserve(places.size());
    for (const Vector2d& uv : places)
        points.emplace_back(static_cast<float>(uv.x()), static_cast<float>(uv.y()));
    return points;
}

Vector2d to_vector(const cv::Point2f& p) {
    return {p.x, p.y};
}

}  // namespace

void Follower::flow(std::vector<Track>& tracks, TrackerReport& report) const {
    std::vector<Vector2d> places, predicted;
    std::vector<Track*> owner;
    for (Track& track : tracks) {
        track.seen = false;
        // What leaves the image would be taken for something like it inside.
        if (track.missed > 0 || !camera_->inside_image(track.expected.uv)) continue;
        owner.push_back(&track);
        places.push_back(track.uv);
        predicted.push_back(track.expected.uv);
    }
    if (owner.empty()) return;
    const std::vector<cv::Point2f> from = to_points(places);
    std::vector<cv::Point2f> to = to_points(predicted);
    std::vector<unsigned char> found;
    std::vector<float> error;
    const cv::TermCriteria stop(cv::TermCriteria::EPS | cv::TermCriteria::COUNT, 20, 0.01);
    cv::calcOpticalFlowPyrLK(images_.previous(), images_.newest(), from, to, found, error,
                             {options_.window_px, options_.window_px}, options_.pyramid_levels,
                             stop, cv::OPTFLOW_USE_INITIAL_FLOW, 1e-4);
    for (std::size_t k = 0; k < owner.size(); ++k) {
        owner[k]->uv = to_vector(to[k]);
        owner[k]->seen = found[k];
        report.lost_flow += !found[k];
    }
}

void Follower::align(std::vector<Track>& tracks, TrackerReport& report) const {
    for (Track& track : tracks) {
        if (!track.seen) continue;
        if (options_.realign) track.seen = align(track, track.uv);
        report.lost_look += !track.seen;
        if (track.seen) track.seen = admissible(track);
        if (track.seen && options_.renew_looks) renew_look(track);
    }
}

void Follower::hold_to_regions(std::vector<Track>& tracks) const {
    std::vector<Track*> outside;
    int told = 0;
    for (Track& track : tracks) {
        if (!track.seen || !track.expected.region) continue;
        ++told;
        const Vector2d e = track.uv - track.expected.uv;
        if (e.dot(track.expected.region->inverse() * e) > kRegion2) outside.push_back(&track);
    }
    if (2 * static_cast<int>(outside.size()) > told) {
        for (Track& track : tracks) track.expected.region.reset();
        return;
    }
    for (Track* track : outside) track->seen = false;
}

// Unless an estimator told, they are expected to have moved against the far scene as their
// neighbours did.
void Follower::search(std::vector<Track>& tracks, TrackerReport& report) const {
    std::vector<std::size_t> found;
    for (std::size_t i = 0; i < tracks.size(); ++i)
        if (tracks[i].seen) found.push_back(i);
    const cv::Mat half = images_.half();
    for (Track& track : tracks) {
        Expectation& expected = track.expected;
        if (track.seen || !camera_->inside_image(expected.uv)) continue;
        if (!expected.region)
            expected.uv += nearest_median(tracks, expected.uv, found, [](const Track& other) {
                return Vector2d(other.uv - other.expected.uv);
            });
        track.uv = expected.uv;
        const auto place =
            track.look->search(half, expected.uv, expected.A,
                               expected.region.value_or(kSearch_px2 * Matrix2d::Identity()));
        if (!place) continue;
        track.seen = align(track, *place) && admissible(track);
        report.found_again += track.seen;
    }
}

// With its look, in its expected shape.
bool Follower::align(Track& track, const Vector2d& uv) const {
    const auto aligned = track.look->align(images_.image(), uv, track.expected.A);
    if (!aligned || aligned->correlation < options_.min_correlation) return false;
    track.uv = aligned->uv_px;
    track.A = aligned->A;
    return true;
}

bool Follower::admissible(Track& track) const {
    const auto ray = camera_->ray(track.uv);
    if (!ray || !camera_->inside_image(track.uv)) return false;
    track.f = ray->direction;
    return mask_.empty() || mask_.at<unsigned char>(static_cast<int>(std::lround(track.uv.y())),
                                                    static_cast<int>(std::lround(track.uv.x())));
}

// What has grown or shrunk much is compared with its latest look: the first one tells no more where
// it is, and would soon not be found at all.
void Follower::renew_look(Track& track) const {
    const Eigen::Vector2d stretch = Eigen::JacobiSVD<Matrix2d>(track.A).singularValues();
    if (stretch[0] < kMostStretch && stretch[1] > 1 / kMostStretch) return;
    auto look = Patch::cut(images_.image(), track.uv);
    if (!look) return;
    *track.look = std::move(*look);
    track.A.setIdentity();
}

}  // namespace vio
