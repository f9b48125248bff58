#include "libvio/check/image_rotations.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "libvio/base/median.h"
#include "libvio/camera/mirror.h"
#include "libvio/geometry/so3.h"
#include "libvio/tracking/rigid_window.h"

namespace vio {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

constexpr int kStretch = 10;      // images that are adjusted together
constexpr int kFewestImages = 5;  // of a stretch
constexpr int kFewestPairs = 15;  // features that two images have in common
constexpr double kLongest = 1.0;  // [s] between images: farther apart, too much may have happened
constexpr double kPairPx = 1.5, kStretchPx = 3;  // largest error of a good feature
constexpr int kHypotheses = 100;
constexpr double kFinestPx = 0.1;     // no feature is placed better
constexpr double kModelError = 5e-4;  // [rad] of lens and gyro
constexpr double kLeastKnown = 1;     // [rad]
constexpr int kApart = 5;             // images, to compare angles: noise would outweigh less motion

std::vector<FeatureRay> rays_of(const Camera& camera, const FeatureFrame& frame) {
    std::vector<FeatureRay> rays;
    for (const FeatureObservation& f : frame.features)
        if (const auto ray = camera.ray(f.uv_px)) rays.push_back({f.feature_id, ray->direction});
    return rays;
}

std::vector<RayPair> pairs_of(const std::vector<FeatureRay>& first,
                              const std::vector<FeatureRay>& second) {
    std::map<FeatureId, Vector3d> directions;
    for (const FeatureRay& ray : first) directions[ray.id] = ray.f;
    std::vector<RayPair> pairs;
    for (const FeatureRay& ray : second)
        if (const auto other = directions.find(ray.id); other != directions.end())
            pairs.push_back({other->second, ray.f});
    return pairs;
}

// Covariance of the rotation from the epipolar errors of the pairs that agree, the direction of
// travel being unknown.
Matrix3d rotation_covariance(const std::vector<RayPair>& pairs, const Matrix3d& R,
                             const Vector3d& t, double threshold, double pixel) {
    Matrix6d H = Matrix6d::Zero();
    std::vector<double> errors;
    for (const RayPair& pair : pairs) {
        if (two_view_residual(pair, R, t) > threshold) continue;
        const Vector3d g = R * pair.f2;
        const double e = t.dot(g.cross(pair.f1));
        const double gradient2 =
            t.cross(g).squaredNorm() + pair.f1.cross(t).squaredNorm() - 2 * e * e;
        if (!(gradient2 > 1e-9)) continue;
        Vector6d J;
        J << pair.f2.cross(R.transpose() * pair.f1.cross(t)), g.cross(pair.f1);
        H += J * J.transpose() / gradient2;
        errors.push_back(std::abs(e) / std::sqrt(gradient2));
    }
    const double sigma = std::max(1.48 * median(errors), kFinestPx * pixel);
    // The length of t is no unknown; its direction is known to within one radian in any case.
    Matrix3d tt = H.bottomRightCorner<3, 3>();
    tt += (H.trace() + 1) * t * t.transpose() + sigma * sigma * Matrix3d::Identity();
    const Matrix3d information =
        (H.topLeftCorner<3, 3>() -
         H.topRightCorner<3, 3>() * tt.inverse() * H.bottomLeftCorner<3, 3>()) /
        (sigma * sigma);
    const Matrix3d least = 1 / (kLeastKnown * kLeastKnown) * Matrix3d::Identity();
    return (information + least).inverse() + kModelError * kModelError * Matrix3d::Identity();
}

}  // namespace

void ImageRotations::add(const FeatureFrame& frame) {
    // A tenth less, so that stamps that tremble do not skip an image.
    if (!frames_.empty() && to_seconds(frame.t - frames_.back().t) < 0.9 * kSpacing) return;
    frames_.push_back(frame);
}

// Stretches share their first and last image with their neighbours; work(begin, end).
template <typename Work>
void ImageRotations::for_stretches(int most, Work work) const {
    const int images = static_cast<int>(frames_.size());
    const int step = std::max(1, (images + most - 1) / std::max(1, most)) * (kStretch - 1);
    for (int i = 0; i + kFewestImages <= images; i += step)
        work(frames_.data() + i, frames_.data() + std::min(images, i + kStretch));
}

std::vector<ImageRotation> ImageRotations::from_pairs(const Camera& camera, int most) const {
    std::vector<ImageRotation> result;
    const double pixel = camera.angular_resolution();
    TwoViewOptions options;
    options.threshold = kPairPx * pixel;
    options.max_hypotheses = kHypotheses;
    for_stretches(most, [&](const FeatureFrame* begin, const FeatureFrame* end) {
        std::vector<FeatureRay> previous = rays_of(camera, *begin);
        for (const FeatureFrame* frame = begin + 1; frame != end; ++frame) {
            std::vector<FeatureRay> rays = rays_of(camera, *frame);
            const std::vector<RayPair> pairs = pairs_of(previous, rays);
            previous = std::move(rays);
            if (to_seconds(frame->t - (frame - 1)->t) > kLongest) continue;
            if (static_cast<int>(pairs.size()) < kFewestPairs) continue;
            const auto motion = estimate_two_view(pairs, std::nullopt, options);
            if (!motion || 2 * motion->inliers < static_cast<int>(pairs.size())) continue;
            result.push_back({(frame - 1)->t, frame->t, so3::log(motion->R_C1_C2),
                              rotation_covariance(pairs, motion->R_C1_C2, motion->t_C1,
                                                  options.threshold, pixel)});
        }
    });
    return result;
}

std::optional<AngularScale> ImageRotations::angular_scale(const Camera& camera, int most) const {
    const double pixel = camera.angular_resolution();
    TwoViewOptions options;
    options.threshold = kStretchPx * pixel;
    options.max_hypotheses = kHypotheses;
    const int images = static_cast<int>(frames_.size());
    const int step = std::max(1, (images + most - 1) / std::max(1, most));
    std::vector<RayViews> views;
    for (int i = 0; i + kApart < images; i += step) {
        const FeatureFrame &first = frames_[i], &second = frames_[i + kApart];
        if (to_seconds(second.t - first.t) > kLongest) continue;
        const std::vector<RayPair> pairs =
            pairs_of(rays_of(camera, first), rays_of(camera, second));
        if (static_cast<int>(pairs.size()) < kFewestPairs) continue;
        const auto motion = estimate_two_view(pairs, std::nullopt, options);
        if (motion && 2 * motion->inliers >= static_cast<int>(pairs.size()))
            views.push_back({pairs, *motion});
    }
    // The middle of a mirror's image shows what lies behind the camera.
    const double axis = dynamic_cast<const MirrorCamera*>(&camera) ? -1 : 1;
    return fit_angular_scale(std::move(views), axis, kFinestPx * pixel);
}

std::vector<ImageRotation> ImageRotations::from_stretches(const Camera& camera, int most,
                                                          const Prediction& predict) const {
    std::vector<ImageRotation> result;
    const double pixel = camera.angular_resolution(), threshold = kStretchPx * pixel;
    for_stretches(most, [&](const FeatureFrame* begin, const FeatureFrame* end) {
        RigidWindow window({kStretch, 1, threshold});
        std::vector<std::vector<FeatureRay>> rays;
        for (const FeatureFrame* frame = begin; frame != end; ++frame) {
            std::optional<Matrix3d> R;
            if (frame != begin) {
                R = predict((frame - 1)->t, frame->t);
                if (!R || to_seconds(frame->t - (frame - 1)->t) > kLongest) return;
            }
            rays.push_back(rays_of(camera, *frame));
            window.check(rays.back(), R.value_or(Matrix3d::Identity()));
        }
        const std::vector<Pose> poses = window.poses();
        for (std::size_t i = 1; i < poses.size(); ++i) {
            const Pose T = poses[i - 1].inverse() * poses[i];
            const std::vector<RayPair> pairs = pairs_of(rays[i - 1], rays[i]);
            if (static_cast<int>(pairs.size()) < kFewestPairs) continue;
            result.push_back(
                {begin[i - 1].t, begin[i].t, so3::log(T.R),
                 rotation_covariance(pairs, T.R, T.p.stableNormalized(), threshold, pixel)});
        }
    });
    return result;
}

}  // namespace vio
