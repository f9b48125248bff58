#include "libvio/tracking/rigid_window.h"

#include <algorithm>
#include <numeric>
#include <random>
#include <utility>

#include "libvio/base/median.h"
#include "libvio/tracking/ray_bundle.h"

namespace vio {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr std::size_t kFewestViews = 4;  // three free translations, two of them up to one scale
constexpr std::size_t kFewestRays = 3;   // that say whether a point is one
constexpr int kFewestPoints = 12;
constexpr int kRaysPerView = 60;  // from which the poses are estimated
constexpr int kIterations = 6, kStartIterations = 30;
// Sum of a good feature's squared errors, each in medians of its view, at most: this for each of n
// rays and some more, since the sum of a few varies more. Gaussian errors have as much once in
// 50,000 features of three rays; real ones are less regular.
constexpr double kSquares = 8, kMoreRays = 1.5;
constexpr double kLeastMedian = 0.08, kMostMedian = 0.3;  // as shares of the threshold
constexpr double kInnerScale = 0.25;  // of the robust cost, as a share of the threshold
// A view shows the scene from where the one before it did if this share of the features has moved
// by less than the threshold beyond what rotation moves them.
constexpr double kStandingShare = 0.75;

// Of all points that enough views saw, in the order of their ids.
RayBundle bundle_of(const std::vector<const std::map<FeatureId, Vector3d>*>& views,
                    std::vector<FeatureId>& ids) {
    std::map<FeatureId, std::vector<RayBundle::Ray>> rays;
    for (std::size_t v = 0; v < views.size(); ++v)
        for (const auto& [id, m] : *views[v]) rays[id].emplace_back(static_cast<int>(v), m);
    RayBundle bundle;
    for (auto& [id, of_point] : rays) {
        if (of_point.size() < kFewestRays) continue;
        bundle.points.push_back({Eigen::Vector4d::UnitZ(), std::move(of_point)});
        ids.push_back(id);
    }
    return bundle;
}

// As few of the points as give every view enough rays. In an arbitrary order: the points that are
// seen longest are far away, and would leave the views' places to chance.
RayBundle part_for_poses(const RayBundle& bundle) {
    std::vector<std::size_t> order(bundle.points.size());
    std::iota(order.begin(), order.end(), 0);
    std::mt19937 random(1);
    for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[random() % i]);
    RayBundle part{bundle.T_W_C, {}, bundle.scale};
    std::vector<int> rays(bundle.T_W_C.size(), 0);
    for (const std::size_t i : order) {
        const RayBundle::Point& point = bundle.points[i];
        const auto wanted = [&](const auto& ray) { return rays[ray.view_idx] < kRaysPerView; };
        if (std::none_of(point.rays.begin(), point.rays.end(), wanted)) continue;
        for (const RayBundle::Ray& ray : point.rays) ++rays[ray.view_idx];
        part.points.push_back(point);
    }
    return part;
}

// Usual angular error in each view [rad]. What some views' places lack is no feature's fault.
std::vector<double> usual_errors(const RayBundle& bundle, double threshold) {
    std::vector<std::vector<double>> of_view(bundle.T_W_C.size());
    for (const RayBundle::Point& point : bundle.points)
        for (const RayBundle::Ray& ray : point.rays)
            of_view[ray.view_idx].push_back(bundle.error(ray, point.h));
    std::vector<double> usual;
    for (std::vector<double>& errors : of_view)
        usual.push_back(std::clamp(errors.empty() ? 0 : median(std::move(errors)),
                                   kLeastMedian * threshold, kMostMedian * threshold));
    return usual;
}

// Whether a point's rays miss it by too much, together: a single one may.
bool misses(const RayBundle& bundle, const RayBundle::Point& point,
            const std::vector<double>& usual) {
    double sum = 0;
    for (const RayBundle::Ray& ray : point.rays) {
        const double e = bundle.error(ray, point.h) / usual[ray.view_idx];
        sum += e * e;
    }
    return sum > kSquares * (static_cast<double>(point.rays.size()) + kMoreRays);
}

}  // namespace

std::vector<FeatureId> RigidWindow::check(const std::vector<FeatureRay>& rays,
                                          const std::optional<Matrix3d>& R_C1_C2) {
    const auto most_views = static_cast<std::size_t>(options_.images / options_.stride);
    if (most_views < kFewestViews) return {};
    if (!R_C1_C2) {
        views_.clear();
        started_ = false;
    } else {
        R_since_view_ = R_since_view_ * *R_C1_C2;
    }
    if (!views_.empty() && ++since_view_ < options_.stride) return {};

    View view;
    view.rays = by_id(rays);
    if (!views_.empty()) {
        view.T_W_C.R = so3::normalized(views_.back().T_W_C.R * R_since_view_);
        view.T_W_C.p = views_.back().T_W_C.p;
        if (started_) view.T_W_C.p += views_.back().T_W_C.p - views_[views_.size() - 2].T_W_C.p;
    }
    if (views_.size() > 1 && stands()) views_.pop_back();  // this one tells the same
    views_.push_back(std::move(view));
    if (views_.size() > most_views) views_.pop_front();
    since_view_ = 0;
    R_since_view_.setIdentity();
    return views_.size() < kFewestViews ? std::vector<FeatureId>() : judge();
}

void RigidWindow::remember(const std::vector<FeatureRay>& rays) {
    if (!views_.empty() && since_view_ == 0) views_.back().rays = by_id(rays);
}

std::map<FeatureId, Vector3d> RigidWindow::by_id(const std::vector<FeatureRay>& rays) {
    std::map<FeatureId, Vector3d> result;
    for (const FeatureRay& ray : rays) result[ray.id] = ray.f;
    return result;
}

// Whether the newest view shows the scene from where the one before it does.
bool RigidWindow::stands() const {
    const View &before = views_[views_.size() - 2], &newest = views_.back();
    const Matrix3d R = before.T_W_C.R.transpose() * newest.T_W_C.R;
    std::vector<double> parallax;
    for (const auto& [id, f] : newest.rays)
        if (const auto then = before.rays.find(id); then != before.rays.end())
            parallax.push_back((then->second - R * f).norm());
    if (parallax.empty()) return false;
    const auto upper =
        parallax.begin() +
        static_cast<std::ptrdiff_t>(kStandingShare * static_cast<double>(parallax.size()));
    std::nth_element(parallax.begin(), upper, parallax.end());
    return *upper < options_.threshold;
}

// Straight ahead at even speed, in the direction that the first and the last view give.
bool RigidWindow::start() {
    std::vector<RayPair> pairs;
    for (const auto& [id, f] : views_.back().rays)
        if (const auto first = views_.front().rays.find(id); first != views_.front().rays.end())
            pairs.push_back({first->second, f});
    TwoViewOptions options;
    options.threshold = options_.threshold;
    const Matrix3d R = views_.front().T_W_C.R.transpose() * views_.back().T_W_C.R;
    const auto motion = estimate_two_view(pairs, R, options);
    if (!motion) return false;
    const Vector3d t = views_.front().T_W_C.R * motion->t_C1;
    for (std::size_t v = 0; v < views_.size(); ++v)
        views_[v].T_W_C.p = static_cast<double>(v) / static_cast<double>(views_.size() - 1) * t;
    return true;
}

std::vector<FeatureId> RigidWindow::judge() {
    const bool warm = started_;
    if (!started_ && !start()) return {};
    std::vector<const std::map<FeatureId, Vector3d>*> rays;
    for (const View& view : views_) rays.push_back(&view.rays);
    std::vector<FeatureId> ids;
    RayBundle bundle = bundle_of(rays, ids);
    bundle.scale = kInnerScale * options_.threshold;
    const Pose to_oldest = views_.front().T_W_C.inverse();
    for (const View& view : views_) bundle.T_W_C.push_back(to_oldest * view.T_W_C);
    RayBundle part = part_for_poses(bundle);
    for (RayBundle::Point& point : part.points) part.triangulate(point);
    part.minimize(warm ? kIterations : kStartIterations);
    bundle.T_W_C = std::move(part.T_W_C);

    for (RayBundle::Point& point : bundle.points) bundle.triangulate(point);
    const std::vector<double> usual = usual_errors(bundle, options_.threshold);
    std::vector<FeatureId> wrong;
    for (std::size_t i = 0; i < ids.size(); ++i)
        if (misses(bundle, bundle.points[i], usual)) wrong.push_back(ids[i]);
    const auto judged = static_cast<int>(ids.size());
    started_ = judged >= kFewestPoints && 2 * static_cast<int>(wrong.size()) < judged;
    if (!started_) return {};
    double farthest = 0;
    for (const Pose& T : bundle.T_W_C) farthest = std::max(farthest, T.p.norm());
    for (std::size_t v = 0; v < views_.size(); ++v) {
        views_[v].T_W_C = bundle.T_W_C[v];
        views_[v].T_W_C.p /= std::max(farthest, 1e-12);
    }
    for (View& view : views_)
        for (const FeatureId id : wrong) view.rays.erase(id);
    return wrong;
}

std::vector<Pose> RigidWindow::poses() const {
    std::vector<Pose> result;
    if (!started_) return result;
    for (const View& view : views_) result.push_back(view.T_W_C);
    return result;
}

}  // namespace vio
