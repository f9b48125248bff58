#include "libvio/recursive/landmark_update.h"

#include <algorithm>

namespace vio {

namespace {

// What the camera sees from one of the state's clones, at the mean or where that is moved by delta.
class View {
 public:
    View(const FilterState& state, int slot, const Camera& camera,
         const Eigen::VectorXd* delta = nullptr)
        : state_(state), slot_(slot), camera_(camera), delta_(delta) {
        T_I_C_ = delta ? state.T_I_C(*delta) : state.mount().T_I_C;
        T_C_I_ = T_I_C_.inverse();
        for (int k = 0; k < static_cast<int>(state.clones().size()); ++k) {
            const Pose& T_W_I = state.clones()[k].T_W_I;
            clones_.push_back(delta ? T_W_I.boxplus(delta->segment<6>(state.clone_offset(k)))
                                    : T_W_I);
        }
    }

    std::optional<PointRows> rows_of(const LandmarkSight& s) const;

 private:
    const FilterState& state_;
    int slot_;
    const Camera& camera_;
    const Eigen::VectorXd* delta_;
    Pose T_I_C_, T_C_I_;
    std::vector<Pose> clones_;
};

// Nothing where the camera cannot image the landmark, or it has come to lie at infinity.
std::optional<PointRows> View::rows_of(const LandmarkSight& s) const {
    const LandmarkState& landmark = state_.landmarks()[s.landmark_idx];
    AnchoredPoint point = landmark.point;
    if (delta_) point.x += delta_->segment<3>(state_.landmark_offset(s.landmark_idx));
    if (!point.in_front()) return std::nullopt;
    const PlacedPoint place = placed(point, clones_[landmark.anchor], T_I_C_);
    const auto seen = sight_residual(camera_, T_C_I_, clones_[slot_], place.p_W, s.sight);
    if (!seen) return std::nullopt;
    PointRows rows;
    rows.landmark_idx = s.landmark_idx;
    rows.slot = slot_;
    rows.residual = seen->residual;
    rows.J_pose << seen->J_rotation, seen->J_position;
    rows.J_anchor << seen->J_point * place.J_rotation, seen->J_point;
    rows.J_camera = seen->J_camera + seen->J_point * place.J_camera;
    rows.J_landmark = seen->J_point * place.J_point;
    return rows;
}

// Covariance of the landmark's whitened prediction.
Eigen::Matrix2d prediction_covariance(const FilterState& state, const PointRows& rows) {
    const auto P = state.covariance();
    Eigen::Matrix<double, 2, 21> J;
    J << rows.J_pose, rows.J_anchor, rows.J_landmark, rows.J_camera;
    const int anchor = state.landmarks()[rows.landmark_idx].anchor;
    const int offset[] = {state.clone_offset(rows.slot), state.clone_offset(anchor),
                          state.landmark_offset(rows.landmark_idx), state.mount_offset()};
    const int own[] = {0, 6, 12, 15}, size[] = {6, 6, 3, 6};
    const int parts = state.mount_size() > 0 ? 4 : 3;
    Eigen::Matrix<double, 21, 21> P_own = Eigen::Matrix<double, 21, 21>::Zero();
    for (int a = 0; a < parts; ++a)
        for (int b = 0; b < parts; ++b)
            P_own.block(own[a], own[b], size[a], size[b]) =
                P.block(offset[a], offset[b], size[a], size[b]);
    return J * P_own * J.transpose();
}

}  // namespace

std::vector<LandmarkSight> gated_sights(const FilterState& state,
                                        const std::vector<LandmarkSight>& sights, int slot,
                                        const Camera& camera, double gate) {
    const View view(state, slot, camera);
    std::vector<LandmarkSight> passed;
    for (const LandmarkSight& s : sights) {
        const auto rows = view.rows_of(s);
        if (!rows) continue;
        const Eigen::Matrix2d S = prediction_covariance(state, *rows) + Eigen::Matrix2d::Identity();
        const double distance2 = rows->residual.dot(S.inverse() * rows->residual);
        if (distance2 < gate) passed.push_back(s);
    }
    return passed;
}

std::vector<LandmarkSight> agreeing_sights(const FilterState& state,
                                           const std::vector<LandmarkSight>& sights, int slot,
                                           const Camera& camera, double gate, double rotation,
                                           double position) {
    constexpr int kRounds = 10;
    constexpr double kLossWidth2 = 9;  // of unit noise, squared
    const View view(state, slot, camera);
    std::vector<LandmarkSight> seen;
    std::vector<PointRows> all;
    for (const LandmarkSight& s : sights) {
        const auto rows = view.rows_of(s);
        if (!rows) continue;
        seen.push_back(s);
        all.push_back(*rows);
    }
    const auto m = static_cast<Eigen::Index>(all.size());
    const int pose = state.clone_offset(slot);
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(2 * m, state.size());
    Eigen::VectorXd residual(2 * m), weight = Eigen::VectorXd::Ones(2 * m), fit(2 * m);
    for (Eigen::Index i = 0; i < m; ++i) {
        const PointRows& rows = all[static_cast<std::size_t>(i)];
        const int anchor = state.landmarks()[rows.landmark_idx].anchor;
        H.block<2, 6>(2 * i, pose) = rows.J_pose;
        H.block<2, 6>(2 * i, state.clone_offset(anchor)) += rows.J_anchor;
        if (state.mount_size() > 0) H.block<2, 6>(2 * i, state.mount_offset()) = rows.J_camera;
        H.block<2, 3>(2 * i, state.landmark_offset(rows.landmark_idx)) = rows.J_landmark;
        residual.segment<2>(2 * i) = rows.residual;
    }
    Vector6d doubt;
    doubt << Eigen::Vector3d::Constant(rotation * rotation),
        Eigen::Vector3d::Constant(position * position);
    const Eigen::MatrixXd HP = H * state.covariance();
    const Eigen::MatrixXd HPHt = HP * H.transpose() + H.middleCols<6>(pose) * doubt.asDiagonal() *
                                                          H.middleCols<6>(pose).transpose();
    // What is left of the residuals is W^-1 S^-1 residual, with S = H P H^T + W^-1.
    for (int round = 0; round < kRounds; ++round) {
        Eigen::MatrixXd S = HPHt;
        S.diagonal() += weight.cwiseInverse();
        fit = S.llt().solve(residual).cwiseQuotient(weight);
        for (Eigen::Index i = 0; i < m; ++i)
            weight.segment<2>(2 * i).setConstant(
                1 / (1 + fit.segment<2>(2 * i).squaredNorm() / kLossWidth2));
    }
    std::vector<LandmarkSight> agree;
    for (Eigen::Index i = 0; i < m; ++i)
        if (fit.segment<2>(2 * i).squaredNorm() < gate)
            agree.push_back(seen[static_cast<std::size_t>(i)]);
    return agree;
}

std::vector<PredictedFeature> predicted_features(const FilterState& state, int slot,
                                                 const Camera& camera) {
    const View view(state, slot, camera);
    std::vector<PredictedFeature> features;
    for (int i = 0; i < static_cast<int>(state.landmarks().size()); ++i) {
        // Against a sight at the image's origin, so that the residual is minus the prediction.
        if (const auto rows = view.rows_of({i, Sight{}}))
            features.push_back(
                {state.landmarks()[i].id, -rows->residual, prediction_covariance(state, *rows)});
    }
    return features;
}

void update_landmarks(FilterState& state, const std::vector<LandmarkSight>& sights, int slot,
                      const Camera& camera, int max_iterations) {
    std::vector<LandmarkSight> in_order = sights;  // that of the state, which updates like
    std::sort(in_order.begin(), in_order.end(), [](const LandmarkSight& a, const LandmarkSight& b) {
        return a.landmark_idx < b.landmark_idx;
    });
    state.update(
        [&](const Eigen::VectorXd& delta, std::vector<PointRows>* rows) {
            rows->clear();
            const View view(state, slot, camera, &delta);
            for (const LandmarkSight& s : in_order)
                if (const auto r = view.rows_of(s)) rows->push_back(*r);
        },
        max_iterations);
}

}  // namespace vio
