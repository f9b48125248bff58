#include "libvio/batch/scale_noise.h"

#include <algorithm>
#include <array>
#include <random>

namespace vio::batch {
namespace {

constexpr int kColumns = 27;  // of an interval's rows

bool is_scaled(int column) {
    const int of_state = column < 15 ? column : column - 15;
    return column < 24 && of_state >= kPosition && of_state < kVelocity + 3;
}

// Where the columns of the rows between images i and i + 1 stand among the unknowns.
std::array<int, kColumns> unknowns_of(const Layout& layout, int i) {
    std::array<int, kColumns> unknowns;
    for (int k = 0; k < 15; ++k) unknowns[k] = layout.index(i, k);
    for (int k = 0; k < 9; ++k) unknowns[15 + k] = layout.index(i + 1, k);
    for (int k = 0; k < 3; ++k) unknowns[24 + k] = layout.gravity_index() + k;
    return unknowns;
}

}  // namespace

double Objective::noise_in_scale(const State& state, const NormalEquations& equations,
                                 const Eigen::VectorXd& c) const {
    constexpr int kProbes = 16;
    using Eigen::MatrixXd;
    const Layout& layout = equations.layout();
    const Eigen::Matrix3d J_gravity = gravity_jacobian(state.gravity);
    const int count = static_cast<int>(intervals_.size());
    std::mt19937 random;
    MatrixXd z(9 * count, kProbes);
    for (double& sign : z.reshaped()) sign = random() % 2 == 0 ? 1 : -1;
    // J_s^T z and J^T z; then P of these.
    MatrixXd q = MatrixXd::Zero(equations.matrix.size(), 2 * kProbes);
    for (int i = 0; i < count; ++i) {
        const auto unknowns = unknowns_of(layout, i);
        const MatrixXd part =
            interval_rows(state, i, J_gravity).J.transpose() * z.middleRows<9>(9 * i);
        for (int k = 0; k < kColumns; ++k) {
            if (is_scaled(k)) q.row(unknowns[k]).head<kProbes>() += part.row(k);
            q.row(unknowns[k]).tail<kProbes>() += part.row(k);
        }
    }
    q = equations.factor().solve(q);
    const Eigen::VectorXd with_c = equations.factor().solve(MatrixXd(c));
    q -= (with_c * (c.transpose() * q) / c.dot(with_c)).eval();
    double sum = 0;
    for (int i = 0; i < count; ++i) {
        const auto unknowns = unknowns_of(layout, i);
        const auto& J = interval_rows(state, i, J_gravity).J;
        MatrixXd motion = MatrixXd::Zero(9, kProbes), left = z.middleRows<9>(9 * i);
        for (int k = 0; k < kColumns; ++k) {
            if (is_scaled(k)) motion += J.col(k) * q.row(unknowns[k]).head<kProbes>();
            left -= J.col(k) * q.row(unknowns[k]).tail<kProbes>();
        }
        sum += left.cwiseProduct(motion).sum();
    }
    return std::max(0.0, sum / kProbes);
}

Eigen::VectorXd scale_reading(const Model& model, const State& state,
                              const NormalEquations& equations) {
    Eigen::VectorXd c = Eigen::VectorXd::Zero(equations.matrix.size());
    double sum = 0;
    for (int i = 1; i < model.frames(); ++i) {
        const Eigen::Vector3d p = state.frames[i].motion.p - state.frames[0].motion.p;
        c.segment<3>(equations.layout().index(i, kPosition)) = p;
        sum += p.squaredNorm();
    }
    if (!(sum > 0)) return {};
    return c / sum;
}

void widen_scale(const Model& model, const Objective& objective, const State& state,
                 NormalEquations& equations) {
    constexpr double kLeastShare = 0.05;  // of motion, lest sigma be infinite
    const Eigen::VectorXd c = scale_reading(model, state, equations);
    if (c.size() == 0) return;
    const double variance = equations.covariance(c)(0, 0);
    const double share =
        std::max(kLeastShare, 1 - objective.noise_in_scale(state, equations, c) * variance);
    equations.widen(c, 1 / (share * share));
}

}  // namespace vio::batch
