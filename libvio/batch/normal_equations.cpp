#include "libvio/batch/normal_equations.h"

#include <algorithm>
#include <cmath>

namespace vio::batch {

BlockMatrix NormalEquations::make_matrix(const Model& model, const Layout& layout) {
    std::vector<std::pair<int, int>> pairs;
    const int global = layout.global_block();
    for (int i = 0; layout.inertial && i < layout.frames; ++i) {
        pairs.emplace_back(layout.motion_block(i), layout.pose_block(i));
        pairs.emplace_back(global, layout.pose_block(i));
        pairs.emplace_back(global, layout.motion_block(i));
        if (i == 0) continue;
        for (int row : {layout.pose_block(i), layout.motion_block(i)})
            for (int col : {layout.pose_block(i - 1), layout.motion_block(i - 1)})
                pairs.emplace_back(row, col);
    }
    for (size_t j = 0; j < model.points.size(); ++j) {
        const Observation* first = &model.observations[model.points[j].first_observation];
        const Observation* end = first + model.points[j].observation_count;
        const int slot = layout.border_of_point[j];
        for (const Observation* a = first; a != end; ++a) {
            const int block = layout.pose_block(a->frame_idx);
            if (slot >= 0)
                pairs.emplace_back(layout.border_block(slot), block);
            else
                for (const Observation* c = first; c != a; ++c)
                    pairs.emplace_back(block, layout.pose_block(c->frame_idx));
        }
    }
    return BlockMatrix(layout.block_dims(), std::move(pairs));
}

NormalEquations::NormalEquations(const Model& model, const Layout& layout)
    : matrix(make_matrix(model, layout)),
      gradient(Eigen::VectorXd::Zero(matrix.size())),
      V(model.points.size()),
      b(model.points.size()),
      W(model.observations.size()),
      model_(model),
      layout_(layout),
      reduced_(matrix),
      factor_(reduced_),
      V_inverse_(model.points.size(), Eigen::Matrix3d::Zero()) {
    for (size_t j = 0; j < model.points.size(); ++j) {
        first_pair_.push_back(pair_positions_.size());
        if (layout.border_of_point[j] >= 0) continue;
        const Observation* first = &model.observations[model.points[j].first_observation];
        for (int a = 0; a < model.points[j].observation_count; ++a)
            for (int c = 0; c <= a; ++c)
                pair_positions_.push_back(matrix.position(layout.pose_block(first[a].frame_idx),
                                                          layout.pose_block(first[c].frame_idx)));
    }
}

void NormalEquations::set_zero() {
    matrix.set_zero();
    gradient.setZero();
    std::fill(V.begin(), V.end(), Eigen::Matrix3d::Zero());
    std::fill(b.begin(), b.end(), Eigen::Vector3d::Zero());
    std::fill(W.begin(), W.end(), Matrix63d::Zero());
}

double NormalEquations::damping(double diagonal) const {
    return lambda_ * std::clamp(diagonal, 1e-6, 1e32);
}

void NormalEquations::eliminate_point(int point_idx) {
    const Point& point = model_.points[point_idx];
    const int* position = pair_positions_.data() + first_pair_[point_idx];
    const Eigen::Matrix3d& Vi = V_inverse_[point_idx];
    for (int a = 0; a < point.observation_count; ++a) {
        const int obs = point.first_observation + a;
        if (!model_.observations[obs].active) {
            position += a + 1;
            continue;
        }
        const Matrix63d T = W[obs] * Vi;
        const int block = layout_.pose_block(model_.observations[obs].frame_idx);
        reduced_gradient_.segment<6>(reduced_.offset(block)).noalias() -= T * b[point_idx];
        for (int c = 0; c <= a; ++c, ++position) {
            const int other = point.first_observation + c;
            const int col = layout_.pose_block(model_.observations[other].frame_idx);
            Eigen::Map<Matrix6d, 0, Eigen::OuterStride<>> S(
                reduced_.values().data() + *position, Eigen::OuterStride<>(reduced_.stride(col)));
            S.noalias() -= T * W[other].transpose();
        }
    }
}

bool NormalEquations::eliminate(double lambda) {
    lambda_ = lambda;
    reduced_.values() = matrix.values();
    reduced_gradient_ = gradient;
    for (size_t j = 0; j < V.size(); ++j) {
        Eigen::Matrix3d damped = V[j];
        const int slot = layout_.border_of_point[j];
        if (slot >= 0) {
            const int block = layout_.border_block(slot);
            reduced_.block(block, block) += damped;
            reduced_gradient_.segment<3>(reduced_.offset(block)) += b[j];
            continue;
        }
        for (int k = 0; k < 3; ++k) damped(k, k) += damping(damped(k, k));
        V_inverse_[j] = damped.inverse();
        if (!V_inverse_[j].allFinite()) return false;
        eliminate_point(static_cast<int>(j));
    }
    reduced_diagonal_.resize(reduced_.size());
    for (int k = 0; k < reduced_.size(); ++k) reduced_diagonal_(k) = matrix.diagonal(k);
    for (size_t j = 0; j < V.size(); ++j)
        if (layout_.border_of_point[j] >= 0)
            reduced_diagonal_.segment<3>(reduced_.offset(
                layout_.border_block(layout_.border_of_point[j]))) = V[j].diagonal();
    if (lambda > 0)
        for (int k = 0; k < reduced_.size(); ++k)
            reduced_.diagonal(k) += damping(reduced_diagonal_(k));
    return true;
}

bool NormalEquations::factorize() {
    return eliminate(0) && factor_.factorize(reduced_);
}

bool NormalEquations::solve(double lambda, Step& step) {
    if (!eliminate(lambda) || !factor_.factorize(reduced_)) return false;
    step.reduced = factor_.solve(-reduced_gradient_);
    step.points.assign(V.size(), Eigen::Vector3d::Zero());
    for (size_t j = 0; j < V.size(); ++j) {
        const int slot = layout_.border_of_point[j];
        if (slot >= 0) {
            step.points[j] = step.reduced.segment<3>(reduced_.offset(layout_.border_block(slot)));
            continue;
        }
        Eigen::Vector3d rhs = b[j];
        const Point& point = model_.points[j];
        for (int k = point.first_observation; k < point.first_observation + point.observation_count;
             ++k) {
            const int block = layout_.pose_block(model_.observations[k].frame_idx);
            rhs.noalias() += W[k].transpose() * step.reduced.segment<6>(reduced_.offset(block));
        }
        step.points[j] = -(V_inverse_[j] * rhs);
    }
    return step.reduced.allFinite();
}

double NormalEquations::predicted_decrease(const Step& step) const {
    // For the damped solution: dx^T (lambda D dx - g), cost being the sum of squares (no 1/2).
    double sum = 0;
    for (int k = 0; k < step.reduced.size(); ++k)
        sum += step.reduced(k) * (damping(reduced_diagonal_(k)) * step.reduced(k) - gradient(k));
    for (size_t j = 0; j < V.size(); ++j) {
        sum -= step.points[j].dot(b[j]);
        if (layout_.border_of_point[j] < 0)
            for (int k = 0; k < 3; ++k)
                sum += step.points[j](k) * step.points[j](k) * damping(V[j](k, k));
    }
    return sum;
}

}  // namespace vio::batch
