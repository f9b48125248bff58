#include "libvio/recursive/window.h"

#include <algorithm>
#include <cmath>

#include "libvio/geometry/so3.h"
#include "libvio/geometry/triangulation.h"

namespace vio {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

constexpr int kMinSights = 3;      // of a point that is used at all
constexpr int kLongestTrack = 64;  // sights, bounds the table of gates
constexpr double kFarthest = 1e3;  // [m]

// Position of a point in sight from given poses, from the sights alone.
std::optional<Vector3d> refined_point(Vector3d p_W, const Camera& camera, const Pose& T_C_I,
                                      const std::vector<Pose>& poses,
                                      const std::vector<Sight>& sights) {
    constexpr int kIterations = 8;
    double cost = -1;
    for (int i = 0; i < kIterations; ++i) {
        Matrix3d A = Matrix3d::Zero();
        Vector3d b = Vector3d::Zero();
        double new_cost = 0;
        for (std::size_t k = 0; k < poses.size(); ++k) {
            const auto seen = sight_residual(camera, T_C_I, poses[k], p_W, sights[k]);
            if (!seen) return std::nullopt;
            A += seen->J_point.transpose() * seen->J_point;
            b += seen->J_point.transpose() * seen->residual;
            new_cost += seen->residual.squaredNorm();
        }
        if (cost >= 0 && std::abs(cost - new_cost) <= 1e-6 * (1 + cost)) return p_W;
        if (cost >= 0 && new_cost > 4 * cost + 100) return std::nullopt;
        cost = new_cost;
        const Vector3d step = A.ldlt().solve(b);
        if (!step.allFinite()) return std::nullopt;
        p_W += step;
    }
    return p_W;
}

}  // namespace

Window::Window(const WindowOptions& options, CameraPtr camera, const Pose& T_I_C)
    : options_(options),
      camera_(std::move(camera)),
      T_I_C_(T_I_C),
      T_C_I_(T_I_C.inverse()),
      gates_(2 * kLongestTrack) {
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
            auto point = split(state, image_idx, id, track);
            const bool landmark = point && candidate && precise(state, *point);
            if (point && (landmark || ended || leaves)) {
                done = true;
                if (!passes_gate(state, *point)) {
                    ++outcome.rejected;
                } else {
                    ++outcome.used;
                    if (landmark) --room;
                    (landmark ? new_landmarks : used).push_back(std::move(*point));
                }
            }
        }
        it = done ? tracks_.erase(it) : std::next(it);
    }
    for (const Split& point : new_landmarks) outcome.landmarks.push_back(point.id);
    if (!new_landmarks.empty()) augment(state, new_landmarks);
    if (!options_.cameras_exact)
        std::move(new_landmarks.begin(), new_landmarks.end(), std::back_inserter(used));
    if (!used.empty()) update(state, used);
    return outcome;
}

std::optional<Window::Split> Window::split(const FilterState& state, int image_idx, FeatureId id,
                                           const Track& track) const {
    std::vector<Pose> poses;
    std::vector<int> columns;
    std::vector<Sight> sights;
    std::vector<SightLine> lines;
    for (const SightAt& s : track) {
        const int slot = s.image_idx == image_idx ? -1 : state.find_clone(s.image_idx);
        if (s.image_idx != image_idx && slot < 0) continue;
        const Pose& T_W_I = slot < 0 ? state.core().T_W_I : state.clones()[slot].T_W_I;
        const auto ray = camera_->ray(s.sight.uv_px);
        if (!ray) continue;
        const Pose T_W_C = T_W_I * T_I_C_;
        lines.push_back({T_W_C * ray->origin, T_W_C.R * ray->direction});
        poses.push_back(T_W_I);
        columns.push_back(slot < 0 ? 0 : state.clone_offset(slot));
        sights.push_back(s.sight);
    }
    const int n = static_cast<int>(poses.size());
    if (n < kMinSights) return std::nullopt;
    const auto rough = triangulate(lines, options_.angular_sigma);
    if (!rough) return std::nullopt;
    const auto p_W = refined_point(rough->point, *camera_, T_C_I_, poses, sights);
    if (!p_W || (*p_W - poses.back().p).norm() > kFarthest) return std::nullopt;

    // [H_l | H_x | r], then the orthogonal factor of H_l applied to all.
    const int w = state.window_size();
    MatrixXd all = MatrixXd::Zero(2 * n, 3 + w + 1);
    for (int i = 0; i < n; ++i) {
        const auto seen = sight_residual(*camera_, T_C_I_, poses[i], *p_W, sights[i]);
        if (!seen) return std::nullopt;
        all.block<2, 3>(2 * i, 0) = seen->J_point;
        all.block<2, 3>(2 * i, 3 + columns[i]) = seen->J_rotation;
        all.block<2, 3>(2 * i, 6 + columns[i]) = seen->J_position;
        all.block<2, 1>(2 * i, 3 + w) = seen->residual;
    }
    Split point;
    point.id = id;
    point.sights = n;
    const MatrixXd H_l = all.leftCols<3>();
    const Eigen::HouseholderQR<MatrixXd> qr(H_l);
    all.applyOnTheLeft(qr.householderQ().adjoint());
    point.R_l = all.topLeftCorner<3, 3>().triangularView<Eigen::Upper>();
    if (!(point.R_l.diagonal().cwiseAbs().minCoeff() >
          1e-9 * point.R_l.diagonal().cwiseAbs().maxCoeff()))
        return std::nullopt;
    const Matrix3d inverse = point.R_l.triangularView<Eigen::Upper>().solve(Matrix3d::Identity());
    point.covariance = inverse * inverse.transpose();
    point.p_W = *p_W + inverse * all.col(3 + w).head<3>();
    point.H_l_x = all.block(0, 3, 3, w);
    point.H = all.block(3, 3, 2 * n - 3, w);
    point.residual = all.col(3 + w).tail(2 * n - 3);
    return point;
}

bool Window::passes_gate(const FilterState& state, const Split& point) const {
    MatrixXd S = state.projected_covariance(point.H);
    S.diagonal().array() += 1;
    const double distance2 = point.residual.dot(S.llt().solve(point.residual));
    return distance2 < gates_[point.residual.size()];
}

bool Window::precise(const FilterState& state, const Split& point) const {
    const double distance = (point.p_W - state.core().T_W_I * T_I_C_.p).norm();
    const Eigen::SelfAdjointEigenSolver<Matrix3d> eigen(point.covariance, Eigen::EigenvaluesOnly);
    return std::sqrt(std::max(0.0, eigen.eigenvalues()(2))) < options_.new_point_sigma * distance;
}

void Window::augment(FilterState& state, const std::vector<Split>& points) const {
    const int k = static_cast<int>(points.size()), w = state.window_size();
    std::vector<LandmarkState> landmarks(k);
    MatrixXd G = MatrixXd::Zero(3 * k, w), noise = MatrixXd::Zero(3 * k, 3 * k);
    for (int i = 0; i < k; ++i) {
        const Split& point = points[i];
        landmarks[i].id = point.id;
        landmarks[i].p_W = point.p_W;
        landmarks[i].observations = point.sights;
        noise.block<3, 3>(3 * i, 3 * i) = point.covariance;
        if (options_.cameras_exact) {  // z_w = T_W_I z_I with the newest pose alone uncertain
            const Vector3d lever = point.p_W - state.core().T_W_I.p;
            G.block<3, 3>(3 * i, kRotation) = -so3::skew(lever) * state.core().T_W_I.R;
            G.block<3, 3>(3 * i, kPosition).setIdentity();
        } else {
            G.middleRows<3>(3 * i) = -point.R_l.triangularView<Eigen::Upper>().solve(point.H_l_x);
        }
    }
    state.augment(landmarks, G, noise);
}

void Window::update(FilterState& state, const std::vector<Split>& points) const {
    Eigen::Index rows = 0;
    const int w = state.window_size();
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
