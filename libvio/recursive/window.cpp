#include "libvio/recursive/window.h"

#include <algorithm>
#include <cmath>

#include "libvio/base/chi_square.h"
#include "libvio/base/median.h"
#include "libvio/geometry/triangulation.h"

namespace vio {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

constexpr int kMinSights = 3;      // of a point that is used at all
constexpr int kLongestTrack = 64;  // sights, bounds the table of gates
// Of a track that fails the gate: width of Cauchy's loss that tells which of its sights agree, and
// how far these may be off [standard deviations of a sight].
constexpr double kLossWidth = 3, kAgrees = 5;

// Squared residuals a sight, in variances, above which another start may lead to a better point.
constexpr double kDoubtful = 4;

struct RefinedPoint {
    AnchoredPoint point;
    double cost;  // squared residuals, in variances
};

// A point in sight from given poses, from the sights alone; it keeps its anchor. least_rho: its
// inverse distance stays above. loss_width: of Cauchy's loss, in standard deviations of a sight; 0:
// none.
std::optional<RefinedPoint> refined_point(AnchoredPoint point, const Pose& anchor,
                                          const Camera& camera, const Pose& T_I_C,
                                          const std::vector<Pose>& poses,
                                          const std::vector<Sight>& sights, double least_rho,
                                          double loss_width) {
    constexpr int kIterations = 8;
    const Pose T_C_I = T_I_C.inverse();
    double cost = -1;
    for (int i = 0; i < kIterations; ++i) {
        Matrix3d A = Matrix3d::Zero();
        Vector3d b = Vector3d::Zero();
        double new_cost = 0;
        if (!point.in_front()) return std::nullopt;
        const PlacedPoint place = placed(point, anchor, T_I_C);
        for (std::size_t k = 0; k < poses.size(); ++k) {
            const auto seen = sight_residual(camera, T_C_I, poses[k], place.p_W, sights[k]);
            if (!seen) return std::nullopt;
            const Matrix23d J = seen->J_point * place.J_point;
            const double r2 = seen->residual.squaredNorm(), width2 = loss_width * loss_width;
            const double weight = loss_width > 0 ? 1 / (1 + r2 / width2) : 1;
            A += weight * J.transpose() * J;
            b += weight * J.transpose() * seen->residual;
            new_cost += loss_width > 0 ? width2 * std::log1p(r2 / width2) : r2;
        }
        if (cost >= 0 && std::abs(cost - new_cost) <= 1e-6 * (1 + cost))
            return RefinedPoint{point, new_cost};
        if (cost >= 0 && new_cost > 4 * cost + 100) return std::nullopt;
        cost = new_cost;
        const Vector3d step = A.ldlt().solve(b);
        if (!step.allFinite()) return std::nullopt;
        point.x += step;
        point.x.z() = std::max(point.x.z(), least_rho);
    }
    return RefinedPoint{point, cost};
}

// So far that the poses, in the anchor's sight, all see it in one direction.
AnchoredPoint far_point(const Vector3d& direction_W, const Pose& anchor, const Pose& T_I_C,
                        const std::vector<Pose>& poses) {
    constexpr double kFar = 100, kLeast = 0.1;  // baselines, and [m]
    double baseline = kLeast;
    for (const Pose& pose : poses) baseline = std::max(baseline, (pose.p - anchor.p).norm());
    return anchored((anchor * T_I_C).p + kFar * baseline * direction_W, anchor, T_I_C);
}

}  // namespace

Window::Window(const WindowOptions& options, CameraPtr camera)
    : options_(options), camera_(std::move(camera)), gates_(2 * kLongestTrack) {
    for (int i = 1; i < static_cast<int>(gates_.size()); ++i)
        gates_[i] = chi_square_quantile(i, options.gate);
}

void Window::observe(FeatureId id, int image_idx, const Sight& sight) {
    Track& track = tracks_[id];
    if (static_cast<int>(track.size()) == kLongestTrack) track.erase(track.begin());
    track.push_back({image_idx, sight});
}

void Window::forget_image(int image_idx) {
    for (auto it = tracks_.begin(); it != tracks_.end();) {
        std::erase_if(it->second, [&](const SightAt& s) { return s.image_idx == image_idx; });
        it = it->second.empty() ? tracks_.erase(it) : std::next(it);
    }
}

Window::Outcome Window::use(FilterState& state, int image_idx, int leaving) {
    Outcome outcome;
    std::vector<double> rhos;
    for (const LandmarkState& landmark : state.landmarks())
        if (landmark.point.in_front()) rhos.push_back(landmark.point.x.z());
    const double usual_rho = rhos.empty() ? 0 : median(std::move(rhos));
    std::vector<Split> new_landmarks, used;
    int room = options_.max_landmarks - static_cast<int>(state.landmarks().size());
    for (auto it = tracks_.begin(); it != tracks_.end();) {
        auto& [id, track] = *it;
        const int sights = static_cast<int>(track.size());
        const bool ended = track.back().image_idx != image_idx;
        const bool leaves = track.front().image_idx == leaving;
        const bool candidate = !ended && room > 0 && sights >= options_.min_sights;
        bool done = ended;
        const bool budget = outcome.used + outcome.rejected < options_.max_points;
        if (sights >= kMinSights && budget && (ended || leaves || candidate)) {
            auto point = split(state, id, track);
            bool landmark = point && candidate && precise(*point, usual_rho);
            if (landmark || ended || leaves) {
                bool good = point && passes_gate(state, *point);
                const auto agree = good ? std::nullopt : agreeing(state, track);
                if (agree) {
                    point = split(state, id, *agree);
                    good = point && passes_gate(state, *point);
                    landmark = good && candidate && precise(*point, usual_rho) &&
                               agree->back().image_idx == image_idx;
                }
                const bool waits = good && !landmark && !ended && !leaves;
                if (point && !waits) {
                    done = true;
                    ++(good ? outcome.used : outcome.rejected);
                    if (good && landmark) --room;
                    if (good) (landmark ? new_landmarks : used).push_back(std::move(*point));
                }
            }
        }
        it = done ? tracks_.erase(it) : std::next(it);
    }
    if (!new_landmarks.empty()) augment(state, new_landmarks);
    if (!options_.cameras_exact)
        std::move(new_landmarks.begin(), new_landmarks.end(), std::back_inserter(used));
    if (!used.empty()) update(state, used);
    return outcome;
}

std::optional<Window::Seen> Window::seen(const FilterState& state, const Track& track,
                                         double loss_width) const {
    const Pose& T_I_C = state.mount().T_I_C;
    Seen seen;
    std::vector<SightLine> lines;
    for (const SightAt& s : track) {
        const int slot = state.find_clone(s.image_idx);
        if (slot < 0) continue;
        const auto ray = camera_->ray(s.sight.uv_px);
        if (!ray) continue;
        const Pose& T_W_I = state.clones()[slot].T_W_I;
        const Pose T_W_C = T_W_I * T_I_C;
        lines.push_back({T_W_C * ray->origin, T_W_C.R * ray->direction});
        seen.poses.push_back(T_W_I);
        seen.slots.push_back(slot);
        seen.sights.push_back(s.sight);
    }
    if (static_cast<int>(seen.poses.size()) < kMinSights) return std::nullopt;
    const auto rough = triangulate(lines, options_.angular_sigma);
    if (!rough) return std::nullopt;
    const Pose& anchor = seen.poses.back();
    const auto refined = [&](const AnchoredPoint& start, double least_rho) {
        return refined_point(start, anchor, *camera_, T_I_C, seen.poses, seen.sights, least_rho,
                             loss_width);
    };
    auto best = refined(anchored(rough->point, anchor, T_I_C), -HUGE_VAL);
    // Where the camera hardly moved, the sight lines may all but meet just before it.
    if (!best || best->cost > kDoubtful * static_cast<double>(seen.sights.size())) {
        const AnchoredPoint far = far_point(lines.back().direction, anchor, T_I_C, seen.poses);
        const auto other = refined(far, far.x.z());
        if (other && (!best || other->cost < best->cost)) best = other;
    }
    if (!best || !best->point.in_front()) return std::nullopt;
    seen.point = best->point;
    return seen;
}

// The sights that agree with one point; nothing if that are all, or not most.
std::optional<Window::Track> Window::agreeing(const FilterState& state, const Track& track) const {
    const auto point = seen(state, track, kLossWidth);
    if (!point) return std::nullopt;
    const Pose T_I_C = state.mount().T_I_C, T_C_I = T_I_C.inverse();
    const Eigen::Vector3d p_W = placed(point->point, point->poses.back(), T_I_C).p_W;
    Track agree;
    for (const SightAt& s : track) {
        const int slot = state.find_clone(s.image_idx);
        if (slot < 0) continue;
        const auto at = sight_residual(*camera_, T_C_I, state.clones()[slot].T_W_I, p_W, s.sight);
        if (at && at->residual.squaredNorm() < kAgrees * kAgrees) agree.push_back(s);
    }
    if (agree.size() == track.size() || 2 * agree.size() <= track.size()) return std::nullopt;
    return agree;
}

std::optional<Window::Split> Window::split(const FilterState& state, FeatureId id,
                                           const Track& track) const {
    const auto found = seen(state, track, 0);
    if (!found) return std::nullopt;
    const auto& [poses, slots, sights, start] = *found;
    const int n = static_cast<int>(poses.size());
    Split split;
    split.id = id;
    split.sights = n;
    split.anchor = slots.back();
    split.point = start;
    const Pose& anchor = poses.back();

    // [H_l | H_x | r], then the orthogonal factor of H_l applied to all.
    const Pose T_I_C = state.mount().T_I_C, T_C_I = T_I_C.inverse();
    const PlacedPoint place = placed(split.point, anchor, T_I_C);
    const int core = state.core_size(), w = state.window_size() - core,  // of mount and clones
        at_anchor = 3 + state.clone_offset(split.anchor) - core;
    MatrixXd all = MatrixXd::Zero(2 * n, 3 + w + 1);
    for (int i = 0; i < n; ++i) {
        const auto seen = sight_residual(*camera_, T_C_I, poses[i], place.p_W, sights[i]);
        if (!seen) return std::nullopt;
        const int at = 3 + state.clone_offset(slots[i]) - core;
        all.block<2, 3>(2 * i, 0) = seen->J_point * place.J_point;
        all.block<2, 3>(2 * i, at) += seen->J_rotation;
        all.block<2, 3>(2 * i, at + 3) += seen->J_position;
        all.block<2, 3>(2 * i, at_anchor) += seen->J_point * place.J_rotation;
        all.block<2, 3>(2 * i, at_anchor + 3) += seen->J_point;
        if (state.mount_size() > 0)
            all.block<2, 6>(2 * i, 3) = seen->J_camera + seen->J_point * place.J_camera;
        all.block<2, 1>(2 * i, 3 + w) = seen->residual;
    }
    const MatrixXd H_l = all.leftCols<3>();
    const Eigen::HouseholderQR<MatrixXd> qr(H_l);
    all.applyOnTheLeft(qr.householderQ().adjoint());
    split.R_l = all.topLeftCorner<3, 3>().triangularView<Eigen::Upper>();
    if (!(split.R_l.diagonal().cwiseAbs().minCoeff() > 0)) return std::nullopt;
    const Matrix3d inverse = split.R_l.triangularView<Eigen::Upper>().solve(Matrix3d::Identity());
    split.covariance = inverse * inverse.transpose();
    split.point.x += inverse * all.col(3 + w).head<3>();
    split.H_l_x = all.block(0, 3, 3, w);
    split.H = all.block(3, 3, 2 * n - 3, w);
    split.residual = all.col(3 + w).tail(2 * n - 3);
    return split;
}

bool Window::passes_gate(const FilterState& state, const Split& point) const {
    MatrixXd S = state.projected_covariance(point.H);
    S.diagonal().array() += 1;
    const double distance2 = point.residual.dot(S.llt().solve(point.residual));
    return distance2 < gates_[point.residual.size()];
}

// Beside what is usual for the points that there are: judged by its own inverse distance, of two
// points with the same error the nearer would come first, hence those that the noise has made so,
// and the motion seen by them would be too small: by 14 % over 600 images of the crane.
bool Window::precise(const Split& split, double usual_rho) const {
    const double sigma = std::sqrt(std::max(0.0, split.covariance(2, 2)));
    const double rho = split.point.x.z();
    return split.point.in_front() &&
           sigma < options_.new_point_sigma * (usual_rho > 0 ? usual_rho : rho);
}

void Window::augment(FilterState& state, const std::vector<Split>& points) const {
    const int k = static_cast<int>(points.size()), w = state.window_size() - state.core_size();
    std::vector<LandmarkState> landmarks(k);
    MatrixXd G = MatrixXd::Zero(3 * k, w), noise = MatrixXd::Zero(3 * k, 3 * k);
    for (int i = 0; i < k; ++i) {
        const Split& point = points[i];
        landmarks[i].id = point.id;
        landmarks[i].anchor = point.anchor;
        landmarks[i].point = point.point;
        landmarks[i].observations = point.sights;
        noise.block<3, 3>(3 * i, 3 * i) = point.covariance;
        // The paper's way takes the poses between which the point was triangulated as exact
        // relative to the newest, its anchor: then its own error does not depend on theirs.
        if (!options_.cameras_exact)
            G.middleRows<3>(3 * i) = -point.R_l.triangularView<Eigen::Upper>().solve(point.H_l_x);
    }
    state.augment(landmarks, G, noise);
}

void Window::update(FilterState& state, const std::vector<Split>& points) const {
    Eigen::Index rows = 0;
    const int w = state.window_size() - state.core_size();
    for (const Split& point : points) rows += point.residual.size();
    MatrixXd all(rows, w + 1);
    Eigen::Index at = 0;
    for (const Split& point : points) {
        all.block(at, 0, point.H.rows(), w) = point.H;
        all.col(w).segment(at, point.residual.size()) = point.residual;
        at += point.residual.size();
    }
    if (rows > w) {  // as many rows as columns say the same
        const Eigen::HouseholderQR<MatrixXd> qr(all);
        all = qr.matrixQR().topRows(w).triangularView<Eigen::Upper>();
    }
    state.update(all.leftCols(w), all.col(w));
}

}  // namespace vio
