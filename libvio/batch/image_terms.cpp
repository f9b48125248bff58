// E_image, Eq. (2): what the image observations add to the error function.
#include <algorithm>
#include <cmath>

#include "libvio/batch/objective.h"
#include "libvio/batch/parallel.h"
#include "libvio/geometry/so3.h"

namespace vio::batch {

double Objective::robust(double distance2) const {
    const double c2 = options_.loss_width * options_.loss_width;
    if (stage_.loss == "cauchy") return c2 * std::log1p(distance2 / c2);
    if (stage_.loss == "huber" && distance2 > c2)
        return 2 * options_.loss_width * std::sqrt(distance2) - c2;
    return distance2;
}

double Objective::robust_weight(double distance2) const {
    const double c2 = options_.loss_width * options_.loss_width;
    if (stage_.loss == "cauchy") return 1 / (1 + distance2 / c2);
    if (stage_.loss == "huber" && distance2 > c2) return options_.loss_width / std::sqrt(distance2);
    return 1;
}

std::optional<Eigen::Vector2d> Objective::image_residual(const State& state,
                                                         const Observation& observation) const {
    const InertialState& I = state.frames[observation.frame_idx].motion;
    const Eigen::Vector3d p_I = I.R.transpose() * (state.points[observation.point_idx] - I.p);
    const auto uv = model_.camera->project(T_C_I_ * p_I);
    if (!uv) return std::nullopt;
    return *uv - observation.uv_px;
}

Eigen::Vector3d Objective::unseen_residual(const Eigen::Vector3d& p_C,
                                           const Observation& observation,
                                           Eigen::Matrix3d* J) const {
    // In whitened pixels: by the mean of the two axes' standard deviations.
    const double weight =
        std::sqrt(observation.sqrt_information.determinant()) / model_.camera->angular_resolution();
    if (J) J->setZero();
    const auto ray = model_.camera->ray(observation.uv_px);
    const Eigen::Vector3d d = ray ? Eigen::Vector3d(p_C - ray->origin) : p_C;
    const double range = d.norm();
    if (!ray || !(range > 0)) return Eigen::Vector3d(2 * weight, 0, 0);
    const Eigen::Vector3d direction = d / range;
    if (J) *J = weight / range * (Eigen::Matrix3d::Identity() - direction * direction.transpose());
    return weight * (direction - ray->direction.normalized());
}

double Objective::observation_distance2(const State& state, const Observation& observation) const {
    if (const auto r = image_residual(state, observation))
        return std::min(largest_distance2_, (observation.sqrt_information * *r).squaredNorm());
    if (stage_.truncated) return largest_distance2_;
    const InertialState& I = state.frames[observation.frame_idx].motion;
    const Eigen::Vector3d p_I = I.R.transpose() * (state.points[observation.point_idx] - I.p);
    return unseen_residual(T_C_I_ * p_I, observation, nullptr).squaredNorm();
}

template <int N>
void Objective::add_observation(const State& state, int k, const Eigen::Matrix<double, N, 1>& r,
                                const Eigen::Matrix<double, N, 3>& J_C, NormalEquations& eq,
                                PoseSums& sums) const {
    const Observation& observation = model_.observations[k];
    const int i = observation.frame_idx, j = observation.point_idx;
    const InertialState& I = state.frames[i].motion;
    const double distance2 = r.squaredNorm();
    sums.cost += robust(distance2);
    const double w = robust_weight(distance2);
    const Eigen::Matrix<double, N, 3> J_I = J_C * T_C_I_.R;
    const Eigen::Matrix<double, N, 3> J_X = J_I * I.R.transpose(), weighted_X = w * J_X;
    eq.V[j].noalias() += weighted_X.transpose() * J_X;
    eq.b[j].noalias() += weighted_X.transpose() * r;
    if (i == 0 && !model_.surveyed()) return;  // held
    const Eigen::Vector3d p_I = I.R.transpose() * (state.points[j] - I.p);
    Eigen::Matrix<double, N, 6> J_pose;
    J_pose << J_I * so3::skew(p_I), -J_X;
    const Eigen::Matrix<double, N, 6> weighted = w * J_pose;
    sums.H[i - sums.first].noalias() += weighted.transpose() * J_pose;
    sums.g[i - sums.first].noalias() += weighted.transpose() * r;
    eq.W[k].noalias() = weighted.transpose() * J_X;
    if (const int slot = eq.layout().border_of_point[j]; slot >= 0)
        eq.matrix.block(eq.layout().border_block(slot), eq.layout().pose_block(i)) +=
            eq.W[k].transpose();
}

void Objective::linearize_observation(const State& state, int k, NormalEquations& eq,
                                      PoseSums& sums) const {
    const Observation& observation = model_.observations[k];
    const InertialState& I = state.frames[observation.frame_idx].motion;
    const Eigen::Vector3d p_C =
        T_C_I_ * (I.R.transpose() * (state.points[observation.point_idx] - I.p));
    Matrix23d J_C;
    if (const auto uv = model_.camera->project(p_C, &J_C)) {
        const Eigen::Vector2d r = observation.sqrt_information * (*uv - observation.uv_px);
        const Matrix23d J = observation.sqrt_information * J_C;
        if (r.squaredNorm() > largest_distance2_)
            sums.cost += robust(largest_distance2_);
        else
            add_observation<2>(state, k, r, J, eq, sums);
    } else if (stage_.truncated) {
        sums.cost += robust(largest_distance2_);
    } else {
        Eigen::Matrix3d J;
        const Eigen::Vector3d r = unseen_residual(p_C, observation, &J);
        add_observation<3>(state, k, r, J, eq, sums);
    }
}

double Objective::linearize_image(const State& state, NormalEquations& eq) {
    const int points = static_cast<int>(model_.points.size());
    in_parallel(threads_, kPieces, [&](int piece) {
        const int begin = piece_begin(points, kPieces, piece),
                  end = piece_begin(points, kPieces, piece + 1);
        PoseSums& sums = pose_sums_[piece];
        int first = model_.frames(), last = -1;
        for (int j = begin; j < end; ++j) {
            const Observation* o = &model_.observations[model_.points[j].first_observation];
            first = std::min(first, o->frame_idx);
            last = std::max(last, o[model_.points[j].observation_count - 1].frame_idx);
        }
        const int frames = std::max(0, last - first + 1);
        sums.first = first;
        sums.cost = 0;
        sums.H.assign(frames, Matrix6d::Zero());
        sums.g.assign(frames, Vector6d::Zero());
        for (int j = begin; j < end; ++j) {
            const Point& point = model_.points[j];
            for (int k = 0; k < point.observation_count; ++k)
                if (model_.observations[point.first_observation + k].active)
                    linearize_observation(state, point.first_observation + k, eq, sums);
        }
    });
    double cost = 0;
    for (const PoseSums& sums : pose_sums_) {
        cost += sums.cost;
        for (size_t f = 0; f < sums.H.size(); ++f) {
            const int block = eq.layout().pose_block(sums.first + static_cast<int>(f));
            eq.matrix.block(block, block) += sums.H[f];
            eq.gradient.segment<6>(eq.matrix.offset(block)) += sums.g[f];
        }
    }
    return cost;
}

}  // namespace vio::batch
