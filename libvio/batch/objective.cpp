#include "libvio/batch/objective.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "libvio/batch/parallel.h"
#include "libvio/geometry/so3.h"

namespace vio::batch {
namespace {

// Surveyed positions given without covariance are held this tightly [m].
constexpr double kExactSurvey = 1e-5;

// Pieces that loops over points and over intervals are cut into.
constexpr int kPieces = 16;

// Biases may move this far [rad/s], [m/s^2] from those that readings were integrated with: the
// correction is of first order, what it leaves out of second, below 1e-6 rad and 1e-5 m/s.
constexpr double kGyroBiasMove = 1e-3, kAccelBiasMove = 1e-2;

Vector6d bias_vector(const ImuBias& bias) {
    Vector6d v;
    v << bias.gyro, bias.accel;
    return v;
}

Eigen::Matrix<double, 3, 2> tangent_basis(const Eigen::Vector3d& direction) {
    const Eigen::Vector3d a = direction.unitOrthogonal();
    Eigen::Matrix<double, 3, 2> basis;
    basis << a, direction.normalized().cross(a);
    return basis;
}

}  // namespace

Objective::Objective(const Model& model, const BatchOptions& options, const Stage& stage)
    : model_(model),
      options_(options),
      stage_(stage),
      threads_(thread_count(options)),
      T_C_I_(model.T_I_C.inverse()),
      pose_sums_(kPieces) {
    const double diagonal = std::hypot(model.camera->width(), model.camera->height());
    largest_distance2_ = stage.truncated
                             ? diagonal * diagonal / (options.sigma_px * options.sigma_px)
                             : std::numeric_limits<double>::infinity();
    if (model.inertial)
        for (int i = 0; i + 1 < model.frames(); ++i) intervals_.push_back(make_interval(i, {}));
}

Objective::Interval Objective::make_interval(int i, const ImuBias& bias) const {
    PreintegratedImu readings(model_.segments[i], bias, model_.interval_noise[i]);
    Matrix9d sqrt_information;
    if (options_.weighting == "fixed") {
        sqrt_information = Matrix9d::Identity() / std::sqrt(options_.fixed_variance);
    } else {
        const Eigen::LLT<Matrix9d> llt(readings.covariance());
        sqrt_information = llt.matrixL().solve(Matrix9d::Identity());
    }
    return {readings, sqrt_information, bias};
}

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

double Objective::prior_weight() const {
    // Eq. (12) multiplies the prior by the number of images, in keeping with the fixed variances; a
    // statistically weighted problem counts it once.
    return options_.weighting == "fixed" ? model_.frames() : 1;
}

Vector6d Objective::bias_walk_information(int i) const {
    const double T = to_seconds(model_.times[i + 1] - model_.times[i]);
    const double g = model_.noise.gyro_bias_random_walk, a = model_.noise.accel_bias_random_walk;
    Vector6d information;
    information << Eigen::Vector3d::Constant(1 / (g * g * T)),
        Eigen::Vector3d::Constant(1 / (a * a * T));
    return information;
}

Eigen::Matrix3d Objective::fiducial_information(const Fiducial& fiducial) const {
    if (fiducial.covariance.isZero(0))
        return Eigen::Matrix3d::Identity() / (kExactSurvey * kExactSurvey);
    return fiducial.covariance.inverse();
}

Eigen::Matrix3d Objective::gravity_jacobian(const Eigen::Vector3d& gravity) const {
    if (stage_.gravity_free) return Eigen::Matrix3d::Identity();
    Eigen::Matrix3d J = Eigen::Matrix3d::Zero();
    J.leftCols<2>() = -so3::skew(gravity) * tangent_basis(gravity);
    return J;
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

Cost Objective::evaluate(const State& state) const {
    std::array<Cost, kPieces> parts;
    const int observations = static_cast<int>(model_.observations.size()),
              intervals = static_cast<int>(intervals_.size());
    in_parallel(threads_, kPieces, [&](int piece) {
        Cost part;
        for (int k = piece_begin(observations, kPieces, piece);
             k < piece_begin(observations, kPieces, piece + 1); ++k)
            if (const Observation& observation = model_.observations[k]; observation.active)
                part.image += robust(observation_distance2(state, observation));
        for (int i = piece_begin(intervals, kPieces, piece);
             i < piece_begin(intervals, kPieces, piece + 1); ++i) {
            const State::Frame &a = state.frames[i], &b = state.frames[i + 1];
            const Vector9d r =
                intervals_[i].readings.residual(a.motion, b.motion, a.bias, state.gravity);
            part.inertial += (intervals_[i].sqrt_information * r).squaredNorm();
            if (options_.bias == "random_walk") {
                const Vector6d d = bias_vector(b.bias) - bias_vector(a.bias);
                part.inertial += d.dot(bias_walk_information(i).cwiseProduct(d));
            }
        }
        parts[piece] = part;
    });
    Cost cost;
    for (const Cost& part : parts) {
        cost.image += part.image;
        cost.inertial += part.inertial;
    }
    if (model_.inertial) {
        const ImuBias& bias = state.frames.front().bias;
        cost.prior += prior_weight() * bias.accel.squaredNorm() /
                      (options_.accel_bias_sigma * options_.accel_bias_sigma);
        cost.prior +=
            bias.gyro.squaredNorm() / (options_.gyro_bias_sigma * options_.gyro_bias_sigma);
    }
    for (size_t j = 0; j < model_.points.size(); ++j)
        if (const Fiducial* fiducial = model_.points[j].fiducial) {
            const Eigen::Vector3d d = state.points[j] - fiducial->p_W;
            cost.prior += d.dot(fiducial_information(*fiducial) * d);
        }
    return cost;
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

double Objective::linearize_interval(const State& state, int i, const Eigen::Matrix3d& J_gravity,
                                     NormalEquations& eq, Matrix9d& global_H,
                                     Vector9d& global_g) const {
    const Layout& layout = eq.layout();
    const State::Frame &a = state.frames[i], &b = state.frames[i + 1];
    const Matrix9d& L = intervals_[i].sqrt_information;
    PreintegratedImu::Jacobian D;
    const Vector9d r =
        L * intervals_[i].readings.residual(a.motion, b.motion, a.bias, state.gravity, &D);
    // Columns: pose i, velocity i, bias, pose j, velocity j, gravity.
    Eigen::Matrix<double, 9, 27> J;
    J.leftCols<9>().noalias() = L * D.state_i;
    if (i == 0 && !model_.surveyed()) J.leftCols<6>().setZero();  // held
    J.middleCols<6>(9).noalias() = L * D.bias;
    J.middleCols<9>(15).noalias() = L * D.state_j;
    J.rightCols<3>().noalias() = L * (D.gravity * J_gravity).eval();
    Eigen::Matrix<double, 27, 27> H;
    H.noalias() = J.transpose() * J;
    const Eigen::Matrix<double, 27, 1> g = J.transpose() * r;

    // Where these columns stand: in which block, from which of its rows on.
    struct Columns {
        int block, column, width, at;
    };
    const int walk = layout.bias_per_frame ? 9 : 3;
    const std::array<Columns, 4> parts{
        Columns{layout.pose_block(i), 0, 6, 0}, Columns{layout.motion_block(i), 6, walk, 0},
        Columns{layout.pose_block(i + 1), 15, 6, 0}, Columns{layout.motion_block(i + 1), 21, 3, 0}};
    const int global = layout.global_block();
    for (const Columns& row : parts) {
        eq.gradient.segment(eq.matrix.offset(row.block) + row.at, row.width) +=
            g.segment(row.column, row.width);
        for (const Columns& col : parts)
            if (row.block >= col.block)
                eq.matrix.block(row.block, col.block).block(row.at, col.at, row.width, col.width) +=
                    H.block(row.column, col.column, row.width, col.width);
        auto border = eq.matrix.block(global, row.block);
        border.topLeftCorner(3, row.width) += H.block(24, row.column, 3, row.width);
        if (!layout.bias_per_frame)
            border.bottomLeftCorner(6, row.width) += H.block(9, row.column, 6, row.width);
    }
    global_H.topLeftCorner<3, 3>() += H.block<3, 3>(24, 24);
    global_H.bottomRightCorner<6, 6>() += H.block<6, 6>(9, 9);
    global_H.bottomLeftCorner<6, 3>() += H.block<6, 3>(9, 24);
    global_H.topRightCorner<3, 6>() += H.block<3, 6>(24, 9);
    global_g.head<3>() += g.tail<3>();
    global_g.tail<6>() += g.segment<6>(9);
    return r.squaredNorm();
}

double Objective::linearize_inertial(const State& state, NormalEquations& eq) const {
    const Eigen::Matrix3d J_gravity = gravity_jacobian(state.gravity);
    struct Sums {
        double cost = 0;
        Matrix9d H = Matrix9d::Zero();
        Vector9d g = Vector9d::Zero();
    };
    std::array<Sums, kPieces> parts;
    const int count = static_cast<int>(intervals_.size());
    const auto add = [&](int piece, int i) {
        Sums& sums = parts[piece];
        sums.cost += linearize_interval(state, i, J_gravity, eq, sums.H, sums.g);
    };
    // The last interval of a piece shares an image with the next piece: these go one by one.
    in_parallel(threads_, kPieces, [&](int piece) {
        for (int i = piece_begin(count, kPieces, piece);
             i + 1 < piece_begin(count, kPieces, piece + 1); ++i)
            add(piece, i);
    });
    double cost = 0;
    const Layout& layout = eq.layout();
    for (int piece = 0; piece < kPieces; ++piece) {
        const int end = piece_begin(count, kPieces, piece + 1);
        if (end > piece_begin(count, kPieces, piece)) add(piece, end - 1);
        cost += parts[piece].cost;
        if (!model_.inertial) continue;
        const int global = layout.global_block(), dim = layout.global_dim();
        eq.matrix.block(global, global) += parts[piece].H.topLeftCorner(dim, dim);
        eq.gradient.segment(eq.matrix.offset(global), dim) += parts[piece].g.head(dim);
    }
    return cost;
}

double Objective::linearize_bias(const State& state, NormalEquations& eq) const {
    if (!model_.inertial || options_.bias != "random_walk") return 0;
    const Layout& layout = eq.layout();
    double cost = 0;
    for (int i = 0; i + 1 < model_.frames(); ++i) {
        const Vector6d d =
            bias_vector(state.frames[i + 1].bias) - bias_vector(state.frames[i].bias);
        const Vector6d information = bias_walk_information(i);
        const Vector6d weighted = information.cwiseProduct(d);
        cost += d.dot(weighted);
        const int a = layout.motion_block(i), b = layout.motion_block(i + 1);
        eq.gradient.segment<6>(eq.matrix.offset(a) + 3) -= weighted;
        eq.gradient.segment<6>(eq.matrix.offset(b) + 3) += weighted;
        eq.matrix.block(a, a).diagonal().tail<6>() += information;
        eq.matrix.block(b, b).diagonal().tail<6>() += information;
        eq.matrix.block(b, a).bottomRightCorner<6, 6>().diagonal() -= information;
    }
    return cost;
}

double Objective::linearize_priors(const State& state, NormalEquations& eq) const {
    double cost = 0;
    if (model_.inertial) {
        const ImuBias& bias = state.frames.front().bias;
        Vector6d information;
        information << Eigen::Vector3d::Constant(
            1 / (options_.gyro_bias_sigma * options_.gyro_bias_sigma)),
            Eigen::Vector3d::Constant(prior_weight() /
                                      (options_.accel_bias_sigma * options_.accel_bias_sigma));
        const Vector6d value = bias_vector(bias), weighted = information.cwiseProduct(value);
        cost += value.dot(weighted);
        const int first = eq.layout().index(0, kGyroBias);
        eq.gradient.segment<6>(first) += weighted;
        for (int k = 0; k < 6; ++k) eq.matrix.diagonal(first + k) += information(k);
    }
    for (size_t j = 0; j < model_.points.size(); ++j)
        if (const Fiducial* fiducial = model_.points[j].fiducial) {
            const Eigen::Matrix3d information = fiducial_information(*fiducial);
            const Eigen::Vector3d d = state.points[j] - fiducial->p_W;
            cost += d.dot(information * d);
            eq.V[j] += information;
            eq.b[j] += information * d;
        }
    return cost;
}

Cost Objective::linearize(const State& state, NormalEquations& equations) {
    const int intervals = static_cast<int>(intervals_.size());
    in_parallel(threads_, kPieces, [&](int piece) {
        for (int i = piece_begin(intervals, kPieces, piece);
             i < piece_begin(intervals, kPieces, piece + 1); ++i) {
            const ImuBias &now = state.frames[i].bias, &then = intervals_[i].bias;
            if ((now.gyro - then.gyro).norm() > kGyroBiasMove ||
                (now.accel - then.accel).norm() > kAccelBiasMove)
                intervals_[i] = make_interval(i, now);
        }
    });
    equations.set_zero();
    Cost cost;
    cost.image = linearize_image(state, equations);
    cost.inertial = linearize_inertial(state, equations) + linearize_bias(state, equations);
    cost.prior = linearize_priors(state, equations);
    // A point that its images leave undetermined (no observation left, or rays without parallax)
    // stays where it is in the directions that they leave open.
    for (Eigen::Matrix3d& V : equations.V) {
        const double mean = V.trace() / 3;
        if (!(V.determinant() > 1e-12 * mean * mean * mean))
            V.diagonal().array() += mean > 0 ? 1e-6 * mean : 1.0;
    }
    // Border points stand among the reduced unknowns.
    for (size_t j = 0; j < model_.points.size(); ++j)
        if (const int slot = equations.layout().border_of_point[j]; slot >= 0) {
            const int block = equations.layout().border_block(slot);
            equations.matrix.block(block, block) += equations.V[j];
            equations.gradient.segment<3>(equations.matrix.offset(block)) += equations.b[j];
        }
    // The gauge: without a survey the first pose defines W.
    if (!model_.surveyed())
        for (int k = 0; k < 6; ++k) equations.hold(equations.layout().index(0, k));
    if (model_.inertial && !stage_.gravity_free)
        equations.hold(equations.layout().gravity_index() + 2);
    return cost;
}

void Objective::apply(const State& state, const Step& step, const Layout& layout,
                      State& next) const {
    next = state;
    for (int i = 0; i < model_.frames(); ++i) {
        State::Frame& frame = next.frames[i];
        const auto part = [&](int component) -> Eigen::Vector3d {
            return step.reduced.segment<3>(layout.index(i, component));
        };
        frame.motion.R = so3::normalized(frame.motion.R * so3::exp(part(kRotation)));
        frame.motion.p += part(kPosition);
        if (!model_.inertial) continue;
        frame.motion.v += part(kVelocity);
        frame.bias.gyro += part(kGyroBias);
        frame.bias.accel += part(kAccelBias);
    }
    for (size_t j = 0; j < model_.points.size(); ++j) next.points[j] += step.points[j];
    if (model_.inertial) {
        const Eigen::Vector3d d = step.reduced.segment<3>(layout.gravity_index());
        if (stage_.gravity_free)
            next.gravity += d;
        else
            next.gravity = so3::exp(tangent_basis(state.gravity) * d.head<2>()) * state.gravity;
    }
}

}  // namespace vio::batch
