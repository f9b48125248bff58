#include "libvio/tracking/view_history.h"

#include <algorithm>

namespace vio {

using Eigen::Matrix3d;

namespace {

constexpr std::size_t kGapFactor = 2;  // the new image is checked against those 1, 2, 4.. back

}  // namespace

std::optional<TwoViewMotion> ViewHistory::check_against(const View& view,
                                                        const std::vector<FeatureRay>& rays,
                                                        const std::optional<Matrix3d>& R,
                                                        std::vector<Verdict>& verdicts) const {
    std::vector<RayPair> pairs;
    std::vector<std::size_t> owner;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        const auto then = view.rays.find(rays[i].id);
        if (then == view.rays.end() || verdicts[i] == Verdict::disagrees) continue;
        pairs.push_back({then->second, rays[i].f});
        owner.push_back(i);
    }
    TwoViewOptions two_view;
    two_view.threshold = threshold_;
    two_view.seed = seed_;
    auto motion = estimate_two_view(pairs, R, two_view);
    if (!motion) return motion;
    for (std::size_t k = 0; k < owner.size(); ++k)
        verdicts[owner[k]] = motion->inlier[k] ? Verdict::agrees : Verdict::disagrees;
    return motion;
}

std::vector<Verdict> ViewHistory::check(const std::vector<FeatureRay>& rays,
                                        std::optional<Matrix3d>& R) {
    std::vector<Verdict> verdicts(rays.size(), Verdict::unchecked);
    inliers_ = 0;
    if (views_.empty()) return verdicts;
    if (const auto motion = check_against(views_.back(), rays, R, verdicts)) {
        R = motion->R_C1_C2;
        inliers_ = motion->inliers;
    }
    views_.back().R_next = R;
    std::optional<Matrix3d> R_back = R;  // from the view that is looked at to the new image
    std::size_t next_gap = kGapFactor;
    for (std::size_t gap = 2; gap <= views_.size(); ++gap) {
        const View& view = views_[views_.size() - gap];
        R_back =
            R_back && view.R_next ? std::optional<Matrix3d>(*view.R_next * *R_back) : std::nullopt;
        if (gap != next_gap) continue;
        next_gap *= kGapFactor;
        if (const auto motion = check_against(view, rays, R_back, verdicts))
            R_back = motion->R_C1_C2;
    }
    return verdicts;
}

void ViewHistory::remember(const std::vector<FeatureRay>& rays) {
    View view;
    for (const FeatureRay& ray : rays) view.rays[ray.id] = ray.f;
    views_.push_back(std::move(view));
    while (static_cast<int>(views_.size()) > std::max(1, length_)) views_.pop_front();
}

}  // namespace vio
