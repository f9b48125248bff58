// E_image, Eq. (2): what the image observations add to the error function.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>

#include "libvio/batch/objective.h"
#include "libvio/batch/parallel.h"
#include "libvio/geometry/so3.h"

namespace vio::batch {

std::optional<Eigen::Vector2d> Objective::image_residual(const State& state,
                                                         const Observation& observation) const {
    const InertialState& I = state.frames[observation.frame_idx].motion;
    const Eigen::Vector3d p_I = I.R.transpose() * (state.points[observation.point_idx] - I.p);
    const auto uv = model_.camera->project(model_.T_C_I * p_I);
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
    return unseen_residual(model_.T_C_I * p_I, observation, nullptr).squaredNorm();
}

template <int N>
void Objective::add_observation(const State& state, int k, const Eigen::Matrix<double, N, 1>& r,
                                const Eigen::Matrix<double, N, 3>& J_C, NormalEquations& eq,
                                PoseSums& sums) const {
    const Observation& observation = model_.observations[k];
    const int i = observation.frame_idx, j = observation.point_idx;
    const InertialState& I = state.frames[i].motion;
    const double distance2 = r.squaredNorm();
    sums.cost += loss_.cost(distance2);
    const double w = image_weight(distance2);
    const Eigen::Matrix<double, N, 3> J_I = J_C * model_.T_C_I.R;
    const Eigen::Matrix<double, N, 3> J_X = J_I * I.R.transpose(), weighted_X = w * J_X;
    eq.V[j].noalias() += weighted_X.transpose() * J_X;
    eq.b[j].noalias() += weighted_X.transpose() * r;
    if (i == 0 && !surveyed_) {  // held
        eq.W[k].setZero();
        return;
    }
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

template <typename Use>
bool Objective::with_residual(const State& state, const Observation& observation, Use use) const {
    const InertialState& I = state.frames[observation.frame_idx].motion;
    const Eigen::Vector3d p_C =
        model_.T_C_I * (I.R.transpose() * (state.points[observation.point_idx] - I.p));
    Matrix23d J_C;
    if (const auto uv = model_.camera->project(p_C, &J_C)) {
        const Eigen::Vector2d r = observation.sqrt_information * (*uv - observation.uv_px);
        if (r.squaredNorm() > largest_distance2_) return false;
        use(r, Matrix23d(observation.sqrt_information * J_C));
        return true;
    }
    if (stage_.truncated) return false;
    Eigen::Matrix3d J;
    const Eigen::Vector3d r = unseen_residual(p_C, observation, &J);
    use(r, J);
    return true;
}

void Objective::linearize_observation(const State& state, int k, NormalEquations& eq,
                                      PoseSums& sums) const {
    const auto add = [&](const auto& r, const auto& J) {
        add_observation(state, k, r, J, eq, sums);
    };
    if (with_residual(state, model_.observations[k], add)) return;
    sums.cost += loss_.cost(largest_distance2_);
    eq.W[k].setZero();
}

Objective::PointSums Objective::point_sums(const State& state, int j) const {
    PointSums sums;
    const Point& point = model_.points[j];
    for (int k = 0; k < point.observation_count; ++k) {
        const Observation& observation = model_.observations[point.first_observation + k];
        if (!observation.active) continue;
        const Eigen::Matrix3d R_C_W =
            model_.T_C_I.R * state.frames[observation.frame_idx].motion.R.transpose();
        const bool pulls = with_residual(state, observation, [&](const auto& r, const auto& J_C) {
            const double distance2 = r.squaredNorm(), w = image_weight(distance2);
            const auto J_X = (J_C * R_C_W).eval();
            sums.V.noalias() += w * J_X.transpose() * J_X;
            sums.b.noalias() += w * J_X.transpose() * r;
            sums.cost += loss_.cost(distance2);
        });
        if (!pulls) sums.cost += loss_.cost(largest_distance2_);
    }
    return sums;
}

double Objective::settle_point(int j, State& state) const {
    constexpr int kSteps = 10;
    const InertialState& I =
        state.frames[model_.observations[model_.points[j].first_observation].frame_idx].motion;
    const Eigen::Vector3d origin = I.R * model_.T_I_C.p + I.p;
    Eigen::Vector3d best = state.points[j], step = Eigen::Vector3d::Zero();
    double cost = std::numeric_limits<double>::infinity();
    for (int k = 0; k < kSteps; ++k) {
        const PointSums sums = point_sums(state, j);
        if (sums.cost < cost) {
            best = state.points[j];
            cost = sums.cost;
            if (undetermined(sums.V)) break;
            step = -sums.V.llt().solve(sums.b);
            if (-step.dot(sums.b) < worth()) break;
        } else {
            step /= 4;
        }
        state.points[j] = origin + displaced(best - origin, step);
    }
    state.points[j] = best;
    return cost;
}

// From where the step leads it, or else from where it was as the camera nearest to it sees it: a
// point just before a camera must follow that camera, or its image is anywhere.
double Objective::settle_point(int j, const State& from, State& state) const {
    const double cost = settle_point(j, state);
    if (cost <= point_costs_[j] + worth()) return cost;
    const Point& point = model_.points[j];
    const Eigen::Vector3d& p_W = from.points[j];
    int nearest = 0;
    double least = std::numeric_limits<double>::infinity();
    for (int k = point.first_observation; k < point.first_observation + point.observation_count;
         ++k) {
        const int i = model_.observations[k].frame_idx;
        const InertialState& I = from.frames[i].motion;
        const double distance2 = (p_W - I.R * model_.T_I_C.p - I.p).squaredNorm();
        if (distance2 >= least) continue;
        least = distance2;
        nearest = i;
    }
    const InertialState &was = from.frames[nearest].motion, &is = state.frames[nearest].motion;
    const Eigen::Vector3d stepped =
        std::exchange(state.points[j], is.R * (was.R.transpose() * (p_W - was.p)) + is.p);
    const double other = settle_point(j, state);
    if (other < cost) return other;
    state.points[j] = stepped;
    return cost;
}

Cost Objective::settle_points(const State& from, State& state) const {
    if (stage_.truncated) return evaluate(state);
    std::array<double, kPieces> parts{};
    in_parallel(threads_, kPieces, [&](int piece) {
        const int points = static_cast<int>(model_.points.size());
        for (int j = piece_begin(points, kPieces, piece);
             j < piece_begin(points, kPieces, piece + 1); ++j)
            parts[piece] += model_.points[j].fiducial ? point_sums(state, j).cost
                                                      : settle_point(j, from, state);
    });
    Cost cost = evaluate_rest(state);
    for (const double part : parts) cost.image += part;
    return cost;
}

Objective::OnePose Objective::one_pose(const State& state,
                                       const std::vector<int>& observations) const {
    OnePose sums;
    for (const int k : observations) {
        const Observation& observation = model_.observations[k];
        const InertialState& I = state.frames[observation.frame_idx].motion;
        const Eigen::Vector3d p_I = I.R.transpose() * (state.points[observation.point_idx] - I.p);
        const bool pulls = with_residual(state, observation, [&](const auto& r, const auto& J_C) {
            const double distance2 = r.squaredNorm(), w = image_weight(distance2);
            const auto J_I = (J_C * model_.T_C_I.R).eval();
            Eigen::Matrix<double, std::decay_t<decltype(r)>::RowsAtCompileTime, 6> J;
            J << J_I * so3::skew(p_I), -J_I * I.R.transpose();
            sums.H.noalias() += w * J.transpose() * J;
            sums.g.noalias() += w * J.transpose() * r;
            sums.cost += loss_.cost(distance2);
        });
        if (!pulls) sums.cost += loss_.cost(largest_distance2_);
    }
    return sums;
}

void Objective::settle_pose(int frame, const std::vector<int>& observations, State& state) const {
    constexpr size_t kFewest = 4;
    constexpr int kSteps = 30;
    if (observations.size() < kFewest) return;
    InertialState& pose = state.frames[frame].motion;
    double lambda = 1e-4;
    OnePose sums = one_pose(state, observations);
    for (int step = 0; step < kSteps; ++step) {
        Matrix6d H = sums.H;
        H.diagonal() *= 1 + lambda;
        const Vector6d d = -H.ldlt().solve(sums.g);
        if (!d.allFinite() || -d.dot(sums.g) < worth()) break;
        const InertialState kept = pose;
        const Pose moved = Pose{pose.R, pose.p}.boxplus(d);
        pose.R = moved.R;
        pose.p = moved.p;
        OnePose now = one_pose(state, observations);
        if (now.cost < sums.cost) {
            sums = std::move(now);
            lambda /= 10;
        } else {
            pose = kept;
            lambda *= 10;
        }
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
            const double before = sums.cost;
            for (int k = point.first_observation;
                 k < point.first_observation + point.observation_count; ++k)
                if (model_.observations[k].active)
                    linearize_observation(state, k, eq, sums);
                else
                    eq.W[k].setZero();
            point_costs_[j] = sums.cost - before;
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
