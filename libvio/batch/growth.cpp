#include "libvio/batch/growth.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "libvio/base/median.h"
#include "libvio/batch/minimize.h"
#include "libvio/batch/start.h"
#include "libvio/geometry/so3.h"
#include "libvio/geometry/triangulation.h"
#include "libvio/tracking/two_view.h"

namespace vio::batch {
namespace {

// An image that is just being placed may be far off: nothing is an outlier yet.
const Stage kPlacing{false, "huber"}, kSettling{false, "cauchy"};

// Observations of each image, by index.
std::vector<std::vector<int>> by_image(const Model& model) {
    std::vector<std::vector<int>> result(model.frames());
    for (size_t k = 0; k < model.observations.size(); ++k)
        result[model.observations[k].frame_idx].push_back(static_cast<int>(k));
    return result;
}

// Images first..last of a model as a model of their own, and which of its points those are.
struct Part {
    Model model;
    std::vector<int> points;
};

Part cut(const Model& whole, const std::vector<bool>& placed, int first, int last) {
    Part part;
    Model& model = part.model;
    model.camera = whole.camera;
    model.T_I_C = whole.T_I_C;
    model.T_C_I = whole.T_C_I;
    model.T_I_B = whole.T_I_B;
    model.times.assign(whole.times.begin() + first, whole.times.begin() + last + 1);
    for (size_t j = 0; j < whole.points.size(); ++j) {
        if (!placed[j]) continue;
        Point point = whole.points[j];
        point.first_observation = static_cast<int>(model.observations.size());
        for (int k = 0; k < whole.points[j].observation_count; ++k) {
            Observation observation = whole.observations[whole.points[j].first_observation + k];
            if (observation.frame_idx < first || observation.frame_idx > last) continue;
            observation.frame_idx -= first;
            observation.point_idx = static_cast<int>(part.points.size());
            model.observations.push_back(observation);
        }
        point.observation_count =
            static_cast<int>(model.observations.size()) - point.first_observation;
        if (point.observation_count == 0) continue;
        model.points.push_back(point);
        part.points.push_back(static_cast<int>(j));
    }
    return part;
}

// Two images, and how many points they tell the distance of.
struct ViewPair {
    int i = 0, j = 0;
    TwoViewMotion motion;
    double worth = 0;
};

class Growth {
 public:
    Growth(const Model& model, const BatchOptions& options)
        : model_(model),
          options_(options),
          observations_(by_image(model)),
          placing_(model, options, kPlacing),
          settling_(model, options, kSettling) {
        state_.frames.resize(model.frames());
        state_.points.resize(model.points.size(), Eigen::Vector3d::Zero());
        placed_.resize(model.points.size(), false);
        has_pose_.resize(model.frames(), false);
        for (const Observation& observation : model.observations) {
            const auto ray = model.camera->ray(observation.uv_px);
            rays_.push_back(ray ? ray->direction : Eigen::Vector3d(Eigen::Vector3d::Zero()));
        }
    }

    std::optional<Grown> run() {
        constexpr double kAlike = 0.01;  // of the cost; wrong minima differ by more, mostly
        std::optional<Seed> best;
        double second = std::numeric_limits<double>::infinity();
        int tried = 0;
        const auto alike = [&] { return second < (1 + kAlike) * best->misfit; };
        for (Seed& seed : plant()) {
            take(std::move(seed));
            grow();
            ++tried;
            const double now = misfit();
            if (!best || now < best->misfit) {
                if (best) second = best->misfit;
                best = here(now);
            } else {
                second = std::min(second, now);
            }
            if (alike()) break;
        }
        if (!best) return std::nullopt;
        const bool confirmed = tried == 1 || alike();
        take(std::move(*best));
        return Grown{in_first_image(), confirmed};
    }

 private:
    void set_camera(int i, const Pose& T_W_C) {
        const Pose T_W_I = T_W_C * model_.T_I_C.inverse();
        state_.frames[i].motion.R = T_W_I.R;
        state_.frames[i].motion.p = T_W_I.p;
    }

    // Pairs of observations of what both images see, by index.
    std::vector<std::pair<int, int>> shared(int i, int j) const {
        std::vector<std::pair<int, int>> result;
        auto b = observations_[j].begin();
        for (const int a : observations_[i]) {
            while (b != observations_[j].end() &&
                   model_.observations[*b].point_idx < model_.observations[a].point_idx)
                ++b;
            if (b == observations_[j].end()) break;
            if (model_.observations[*b].point_idx == model_.observations[a].point_idx)
                result.emplace_back(a, *b);
        }
        return result;
    }

    std::optional<ViewPair> judge_pair(int i, int j) const {
        constexpr double kEnough = 0.2;  // parallax [rad] beyond which a point gains little
        constexpr double kInlier = 3;    // standard deviations
        std::vector<RayPair> pairs;
        for (const auto& [a, b] : shared(i, j))
            if (!rays_[a].isZero() && !rays_[b].isZero()) pairs.push_back({rays_[a], rays_[b]});
        TwoViewOptions options;
        options.threshold =
            kInlier * options_.sigma_px * model_.camera->angular_resolution() * M_SQRT2;
        auto motion = estimate_two_view(pairs, std::nullopt, options);
        if (!motion) return std::nullopt;
        ViewPair result{i, j, std::move(*motion), 0};
        for (size_t k = 0; k < pairs.size(); ++k) {
            if (!result.motion.inlier[k]) continue;
            const double cosine = pairs[k].f1.dot(result.motion.R_C1_C2 * pairs[k].f2);
            result.worth += std::min(1.0, std::acos(std::clamp(cosine, -1.0, 1.0)) / kEnough);
        }
        return result;
    }

    // The further apart two images are, the more parallax and the fewer points they share.
    std::vector<ViewPair> best_pairs() const {
        constexpr int kFirsts = 10;
        constexpr size_t kPairs = 4;
        constexpr double kLeastWorth = 2;
        std::vector<ViewPair> pairs;
        const int all = model_.frames();
        for (int k = 0; k < kFirsts; ++k) {
            const int i = all * k / kFirsts;
            if (k > 0 && i == all * (k - 1) / kFirsts) continue;
            std::optional<ViewPair> best;
            for (int apart = 2, j; (j = i + apart) < all; apart += std::max(1, apart / 2)) {
                auto pair = judge_pair(i, j);
                if (!pair) break;
                if (pair->worth > (best ? best->worth : kLeastWorth)) best = std::move(pair);
            }
            if (best) pairs.push_back(std::move(*best));
        }
        std::sort(pairs.begin(), pairs.end(),
                  [](const ViewPair& a, const ViewPair& b) { return a.worth > b.worth; });
        pairs.resize(std::min(pairs.size(), kPairs));
        return pairs;
    }

    // By the nearest image that is placed and, at constant velocity, the one before it (or -1).
    void place_image(int i, int nearest, int before) {
        place_pose_after(nearest, before, state_.frames[i]);
        std::vector<int> known;
        for (const int k : observations_[i])
            if (placed_[model_.observations[k].point_idx]) known.push_back(k);
        placing_.settle_pose(i, known, state_);
        settling_.settle_pose(i, known, state_);
        has_pose_[i] = true;
    }

    // From the images that are placed to all.
    void grow() {
        while (first_ > 0 || last_ + 1 < model_.frames()) {
            const int more = std::max(2, (last_ - first_ + 1) / 8);
            extend_backwards(more);
            extend_forwards(more);
            settle(first_, last_);
        }
    }

    // Images first..last with poses, points that they place, and what an observation costs.
    struct Seed {
        State state;
        std::vector<bool> placed, has_pose;
        int first = 0, last = 0;
        double misfit = 0;
    };

    Seed here(double misfit) const { return {state_, placed_, has_pose_, first_, last_, misfit}; }

    void take(Seed seed) {
        state_ = std::move(seed.state);
        placed_ = std::move(seed.placed);
        has_pose_ = std::move(seed.has_pose);
        first_ = seed.first;
        last_ = seed.last;
    }

    // Two views may deceive, but hardly the images between them too: the best pairs in the order in
    // which these agree with them.
    std::vector<Seed> plant() {
        std::vector<Seed> seeds;
        const Seed blank = here(0);
        for (const ViewPair& pair : best_pairs()) {
            take(blank);
            const double misfit = grow_between(pair);
            if (std::isfinite(misfit)) seeds.push_back(here(misfit));
        }
        std::sort(seeds.begin(), seeds.end(),
                  [](const Seed& a, const Seed& b) { return a.misfit < b.misfit; });
        return seeds;
    }

    // Two images and those between them; returns the cost of an observation.
    double grow_between(const ViewPair& pair) {
        first_ = pair.i;
        last_ = pair.j;
        set_camera(first_, Pose{});
        set_camera(last_, Pose{pair.motion.R_C1_C2, pair.motion.t_C1});
        has_pose_[first_] = has_pose_[last_] = true;
        place_points();
        for (int i = first_ + 1; i < last_; ++i) place_image(i, i - 1, -1);
        return settle(first_, last_);
    }

    void extend_forwards(int more) {
        for (int k = 1; k <= more && last_ + 1 < model_.frames(); ++k) {
            place_image(last_ + 1, last_, last_ - 1);
            ++last_;
            place_points();
            if (k % kBetween == 0) settle(std::max(first_, last_ - kWindow), last_);
        }
    }

    void extend_backwards(int more) {
        for (int k = 1; k <= more && first_ > 0; ++k) {
            place_image(first_ - 1, first_, first_ + 1);
            --first_;
            place_points();
            if (k % kBetween == 0) settle(first_, std::min(last_, first_ + kWindow));
        }
    }

    void place_pose_after(int nearest, int before, State::Frame& frame) const {
        frame = state_.frames[nearest];
        if (before < 0 || !has_pose_[before]) return;
        InertialState& motion = frame.motion;
        const InertialState& earlier = state_.frames[before].motion;
        motion.p += motion.p - earlier.p;
        motion.R = so3::normalized(motion.R * earlier.R.transpose() * motion.R);
    }

    // Points that the images with poses see under enough parallax, and that most of them agree on.
    void place_points() {
        for (int j = 0; j < static_cast<int>(model_.points.size()); ++j) {
            if (placed_[j]) continue;
            const Point& point = model_.points[j];
            std::vector<SightLine> lines;
            for (int k = point.first_observation;
                 k < point.first_observation + point.observation_count; ++k)
                if (has_pose_[model_.observations[k].frame_idx] && !rays_[k].isZero())
                    lines.push_back(sight_line(k));
            placed_[j] = place_point(j, lines);
        }
    }

    bool place_point(int j, const std::vector<SightLine>& lines) {
        constexpr double kParallax = 0.03;  // [rad]
        constexpr size_t kPairs = 6;
        const auto from = [&](const std::vector<SightLine>& chosen) {
            const auto found = triangulate(chosen, model_.camera->angular_resolution());
            if (!found || found->parallax < kParallax) return false;
            state_.points[j] = found->point;
            return fits(j);
        };
        if (from(lines)) return true;
        // Some of them may be of something else.
        for (size_t k = 0; k < kPairs && lines.size() > 3; ++k) {
            const size_t a = k * lines.size() / (2 * kPairs);
            if (from({lines[a], lines[a + lines.size() / 2]})) return true;
        }
        return false;
    }

    SightLine sight_line(int k) const {
        const InertialState& I = state_.frames[model_.observations[k].frame_idx].motion;
        const Pose T_W_C = Pose{I.R, I.p} * model_.T_I_C;
        return {T_W_C.p, T_W_C.R * rays_[k]};
    }

    // Whether most of the images that have poses agree with where a point is.
    bool fits(int j) const {
        constexpr double kFar = 5;  // standard deviations
        const Point& point = model_.points[j];
        int seen = 0, near = 0;
        for (int k = point.first_observation; k < point.first_observation + point.observation_count;
             ++k) {
            const Observation& observation = model_.observations[k];
            if (!has_pose_[observation.frame_idx]) continue;
            ++seen;
            near += settling_.observation_distance2(state_, observation) < kFar * kFar;
        }
        return 2 * near > seen;
    }

    // Some images with their points, together; then further points.
    // Returns what an observation costs.
    double settle(int first, int last) {
        for (int j = 0; j < static_cast<int>(model_.points.size()); ++j)
            placed_[j] = placed_[j] && fits(j);
        place_points();
        Part part = cut(model_, placed_, first, last);
        if (part.points.empty()) return std::numeric_limits<double>::infinity();
        State state;
        state.frames.assign(state_.frames.begin() + first, state_.frames.begin() + last + 1);
        for (const int j : part.points) state.points.push_back(state_.points[j]);
        NormalEquations equations(part.model, make_layout(part.model, options_),
                                  thread_count(options_));
        Objective objective(part.model, options_, kSettling);
        const MinimizeReport report =
            minimize(objective, equations, {kSettlingIterations, 1e-3}, state);
        std::copy(state.frames.begin(), state.frames.end(), state_.frames.begin() + first);
        for (size_t j = 0; j < part.points.size(); ++j) {
            state_.points[part.points[j]] = state.points[j];
            placed_[part.points[j]] = fits(part.points[j]);
        }
        place_points();
        return report.final.total() / static_cast<double>(part.model.observations.size());
    }

    // Cost of an observation of all placed points.
    double misfit() const {
        double sum = 0;
        int count = 0;
        for (const Observation& observation : model_.observations)
            if (placed_[observation.point_idx]) {
                sum += settling_.observation_cost(state_, observation);
                ++count;
            }
        return count > 0 ? sum / count : std::numeric_limits<double>::infinity();
    }

    State in_first_image() {
        const InertialState& first = state_.frames.front().motion;
        const Pose T_C_W = (Pose{first.R, first.p} * model_.T_I_C).inverse();
        std::vector<double> ranges;
        for (size_t j = 0; j < model_.points.size(); ++j)
            if (placed_[j]) {
                const int i = model_.observations[model_.points[j].first_observation].frame_idx;
                const InertialState& I = state_.frames[i].motion;
                ranges.push_back((state_.points[j] - I.R * model_.T_I_C.p - I.p).norm());
            }
        const double scale =
            ranges.empty() ? 1 : options_.blind_distance / median(std::move(ranges));
        for (int i = 0; i < model_.frames(); ++i) {
            const InertialState& I = state_.frames[i].motion;
            Pose T_C0_C = T_C_W * Pose{I.R, I.p} * model_.T_I_C;
            T_C0_C.p *= scale;
            set_camera(i, model_.T_I_C * T_C0_C);
        }
        for (size_t j = 0; j < model_.points.size(); ++j)
            state_.points[j] = model_.T_I_C * (scale * (T_C_W * state_.points[j]));
        place_other_points(model_, placed_, state_);
        return std::move(state_);
    }

    static constexpr int kSettlingIterations = 8;
    static constexpr int kBetween = 4, kWindow = 30;  // images
    const Model& model_;
    const BatchOptions& options_;
    std::vector<std::vector<int>> observations_;
    Objective placing_, settling_;
    State state_;
    std::vector<bool> placed_, has_pose_;
    std::vector<Eigen::Vector3d> rays_;
    int first_ = 0, last_ = 0;
};

}  // namespace

std::optional<Grown> grow_from_two_views(const Model& model, const BatchOptions& options) {
    return Growth(model, options).run();
}

}  // namespace vio::batch
