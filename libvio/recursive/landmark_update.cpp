#include "libvio/recursive/landmark_update.h"

#include <algorithm>

namespace vio {

namespace {

// Nothing where the camera cannot image the landmark, or it has come to lie at infinity.
std::optional<PointRows> rows_of(const LandmarkSight& s, const AnchoredPoint& point,
                                 const Pose& T_W_I, const Pose& T_W_I_anchor, const Camera& camera,
                                 const Pose& T_I_C, const Pose& T_C_I) {
    if (!point.in_front()) return std::nullopt;
    const PlacedPoint place = placed(point, T_W_I_anchor, T_I_C);
    const auto seen = sight_residual(camera, T_C_I, T_W_I, place.p_W, s.sight);
    if (!seen) return std::nullopt;
    PointRows rows;
    rows.landmark_idx = s.landmark_idx;
    rows.residual = seen->residual;
    rows.J_pose << seen->J_rotation, seen->J_position;
    rows.J_anchor << seen->J_point * place.J_rotation, seen->J_point;
    rows.J_landmark = seen->J_point * place.J_point;
    return rows;
}

// Covariance of the landmark's whitened prediction.
Eigen::Matrix2d prediction_covariance(const FilterState& state, const PointRows& rows) {
    const auto P = state.covariance();
    Eigen::Matrix<double, 2, 15> J;
    J << rows.J_pose, rows.J_anchor, rows.J_landmark;
    const int anchor = state.landmarks()[rows.landmark_idx].anchor;
    const int offset[] = {0, state.clone_offset(anchor), state.landmark_offset(rows.landmark_idx)};
    const int own[] = {0, 6, 12}, size[] = {6, 6, 3};
    Eigen::Matrix<double, 15, 15> P_own;
    for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b)
            P_own.block(own[a], own[b], size[a], size[b]) =
                P.block(offset[a], offset[b], size[a], size[b]);
    return J * P_own * J.transpose();
}

}  // namespace

std::vector<LandmarkSight> gated_sights(const FilterState& state,
                                        const std::vector<LandmarkSight>& sights,
                                        const Camera& camera, const Pose& T_I_C, double gate) {
    const Pose T_C_I = T_I_C.inverse();
    std::vector<LandmarkSight> passed;
    for (const LandmarkSight& s : sights) {
        const LandmarkState& landmark = state.landmarks()[s.landmark_idx];
        const auto rows = rows_of(s, landmark.point, state.core().T_W_I,
                                  state.clones()[landmark.anchor].T_W_I, camera, T_I_C, T_C_I);
        if (!rows) continue;
        const Eigen::Matrix2d S = prediction_covariance(state, *rows) + Eigen::Matrix2d::Identity();
        const double distance2 = rows->residual.dot(S.inverse() * rows->residual);
        if (distance2 < gate) passed.push_back(s);
    }
    return passed;
}

std::vector<LandmarkSight> agreeing_sights(const FilterState& state,
                                           const std::vector<LandmarkSight>& sights,
                                           const Camera& camera, const Pose& T_I_C, double gate,
                                           double rotation, double position) {
    constexpr int kRounds = 10;
    constexpr double kLossWidth2 = 9;  // of unit noise, squared
    const Pose T_C_I = T_I_C.inverse();
    std::vector<LandmarkSight> seen;
    std::vector<PointRows> all;
    for (const LandmarkSight& s : sights) {
        const LandmarkState& landmark = state.landmarks()[s.landmark_idx];
        const auto rows = rows_of(s, landmark.point, state.core().T_W_I,
                                  state.clones()[landmark.anchor].T_W_I, camera, T_I_C, T_C_I);
        if (!rows) continue;
        seen.push_back(s);
        all.push_back(*rows);
    }
    const auto m = static_cast<Eigen::Index>(all.size());
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(2 * m, state.size());
    Eigen::VectorXd residual(2 * m), weight = Eigen::VectorXd::Ones(2 * m), fit(2 * m);
    for (Eigen::Index i = 0; i < m; ++i) {
        const PointRows& rows = all[static_cast<std::size_t>(i)];
        const int anchor = state.landmarks()[rows.landmark_idx].anchor;
        H.block<2, 6>(2 * i, 0) = rows.J_pose;
        H.block<2, 6>(2 * i, state.clone_offset(anchor)) += rows.J_anchor;
        H.block<2, 3>(2 * i, state.landmark_offset(rows.landmark_idx)) = rows.J_landmark;
        residual.segment<2>(2 * i) = rows.residual;
    }
    Vector6d doubt;
    doubt << Eigen::Vector3d::Constant(rotation * rotation),
        Eigen::Vector3d::Constant(position * position);
    const Eigen::MatrixXd HP = H * state.covariance();
    const Eigen::MatrixXd HPHt =
        HP * H.transpose() + H.leftCols<6>() * doubt.asDiagonal() * H.leftCols<6>().transpose();
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

std::vector<PredictedFeature> predicted_features(const FilterState& state, const Camera& camera,
                                                 const Pose& T_I_C) {
    const Pose T_C_I = T_I_C.inverse();
    std::vector<PredictedFeature> features;
    for (int i = 0; i < static_cast<int>(state.landmarks().size()); ++i) {
        const LandmarkState& landmark = state.landmarks()[i];
        // Against a sight at the image's origin, so that the residual is minus the prediction.
        const auto rows = rows_of({i, Sight{}}, landmark.point, state.core().T_W_I,
                                  state.clones()[landmark.anchor].T_W_I, camera, T_I_C, T_C_I);
        if (rows)
            features.push_back({landmark.id, -rows->residual, prediction_covariance(state, *rows)});
    }
    return features;
}

void update_landmarks(FilterState& state, const std::vector<LandmarkSight>& sights,
                      const Camera& camera, const Pose& T_I_C, int max_iterations) {
    const Pose T_C_I = T_I_C.inverse();
    std::vector<LandmarkSight> in_order = sights;  // that of the state, which updates like
    std::sort(in_order.begin(), in_order.end(), [](const LandmarkSight& a, const LandmarkSight& b) {
        return a.landmark_idx < b.landmark_idx;
    });
    state.update(
        [&](const Eigen::VectorXd& delta, std::vector<PointRows>* rows) {
            rows->clear();
            const Pose T_W_I = state.core().T_W_I.boxplus(delta.head<6>());
            for (const LandmarkSight& s : in_order) {
                const LandmarkState& landmark = state.landmarks()[s.landmark_idx];
                const int slot = landmark.anchor;
                AnchoredPoint point = landmark.point;
                point.x += delta.segment<3>(state.landmark_offset(s.landmark_idx));
                const Pose anchor =
                    state.clones()[slot].T_W_I.boxplus(delta.segment<6>(state.clone_offset(slot)));
                if (const auto r = rows_of(s, point, T_W_I, anchor, camera, T_I_C, T_C_I))
                    rows->push_back(*r);
            }
        },
        max_iterations);
}

}  // namespace vio
