#include "libvio/recursive/landmark_update.h"

namespace vio {

std::vector<LandmarkSight> gated_sights(const FilterState& state,
                                        const std::vector<LandmarkSight>& sights,
                                        const Camera& camera, const Pose& T_C_I, double gate) {
    std::vector<LandmarkSight> passed;
    const auto P = state.covariance();
    for (const LandmarkSight& s : sights) {
        const auto seen = sight_residual(camera, T_C_I, state.core().T_W_I,
                                         state.landmarks()[s.landmark_idx].p_W, s.sight);
        if (!seen) continue;
        const int at = state.landmark_offset(s.landmark_idx);
        Eigen::Matrix<double, 2, 9> J;
        J << seen->J_rotation, seen->J_position, seen->J_point;
        Eigen::Matrix<double, 9, 9> P_own;
        P_own.topLeftCorner<6, 6>() = P.topLeftCorner<6, 6>();
        P_own.bottomLeftCorner<3, 6>() = P.block<3, 6>(at, 0);
        P_own.topRightCorner<6, 3>() = P.block<6, 3>(0, at);
        P_own.bottomRightCorner<3, 3>() = P.block<3, 3>(at, at);
        const Eigen::Matrix2d S = J * P_own * J.transpose() + Eigen::Matrix2d::Identity();
        const double distance2 = seen->residual.dot(S.inverse() * seen->residual);
        if (distance2 < gate) passed.push_back(s);
    }
    return passed;
}

void update_landmarks(FilterState& state, const std::vector<LandmarkSight>& sights,
                      const Camera& camera, const Pose& T_C_I, int max_iterations) {
    const CoreState prior = state.core();
    state.update(
        [&](const Eigen::VectorXd& delta, std::vector<PointRows>* rows) {
            rows->clear();
            const Pose T_W_I = prior.T_W_I.boxplus(delta.head<6>());
            for (const LandmarkSight& s : sights) {
                const Eigen::Vector3d p_W = state.landmarks()[s.landmark_idx].p_W +
                                            delta.segment<3>(state.landmark_offset(s.landmark_idx));
                if (const auto seen = sight_residual(camera, T_C_I, T_W_I, p_W, s.sight))
                    rows->push_back({s.landmark_idx, seen->residual, seen->J_rotation,
                                     seen->J_position, seen->J_point});
            }
        },
        max_iterations);
}

}  // namespace vio
