#include "libvio/batch/objective.h"

#include <cmath>

#include "libvio/geometry/so3.h"

namespace vio::batch {
namespace {

// Surveyed positions given without covariance are held this tightly [m].
constexpr double kExactSurvey = 1e-5;

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
    : model_(model), options_(options), stage_(stage) {
    // As far off as the image is large: leaving the field of view never pays.
    const double size_px = std::hypot(model.camera->width(), model.camera->height());
    unseen_distance2_ = size_px * size_px / (options.sigma_px * options.sigma_px);
    if (model.inertial)
        for (int i = 0; i + 1 < model.frames(); ++i) intervals_.push_back(make_interval(i, {}));
}

Objective::Interval Objective::make_interval(int i, const ImuBias& bias) const {
    PreintegratedImu readings(model_.segments[i], bias, model_.noise);
    Matrix9d sqrt_information;
    if (options_.weighting == "fixed") {
        sqrt_information = Matrix9d::Identity() / std::sqrt(options_.fixed_variance);
    } else {
        const Eigen::LLT<Matrix9d> llt(readings.covariance());
        sqrt_information = llt.matrixL().solve(Matrix9d::Identity());
    }
    return {readings, sqrt_information};
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
    const auto uv = model_.camera->project(model_.T_I_C.inverse() * p_I);
    if (!uv) return std::nullopt;
    return *uv - observation.uv_px;
}

double Objective::observation_distance2(const State& state, const Observation& observation) const {
    const auto r = image_residual(state, observation);
    if (!r) return unseen_distance2_;
    return std::min(unseen_distance2_, (observation.sqrt_information * *r).squaredNorm());
}

Cost Objective::evaluate(const State& state) const {
    Cost cost;
    for (const Observation& observation : model_.observations)
        if (observation.active) cost.image += robust(observation_distance2(state, observation));
    for (size_t i = 0; i < intervals_.size(); ++i) {
        const State::Frame &a = state.frames[i], &b = state.frames[i + 1];
        const Vector9d r =
            intervals_[i].readings.residual(a.motion, b.motion, a.bias, state.gravity);
        cost.inertial += (intervals_[i].sqrt_information * r).squaredNorm();
        if (options_.bias == "random_walk") {
            const Vector6d d = bias_vector(b.bias) - bias_vector(a.bias);
            cost.inertial += d.dot(bias_walk_information(static_cast<int>(i)).cwiseProduct(d));
        }
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

double Objective::linearize_image(const State& state, NormalEquations& eq) const {
    const Layout& layout = eq.layout();
    const Pose T_C_I = model_.T_I_C.inverse();
    const bool first_pose_held = !model_.surveyed();
    double cost = 0;
    for (size_t k = 0; k < model_.observations.size(); ++k) {
        const Observation& observation = model_.observations[k];
        if (!observation.active) continue;
        const int i = observation.frame_idx, j = observation.point_idx;
        const InertialState& I = state.frames[i].motion;
        const Eigen::Vector3d p_I = I.R.transpose() * (state.points[j] - I.p);
        Matrix23d J_C;
        const auto uv = model_.camera->project(T_C_I * p_I, &J_C);
        Eigen::Vector2d r;
        if (uv) r = observation.sqrt_information * (*uv - observation.uv_px);
        if (!uv || r.squaredNorm() > unseen_distance2_) {
            cost += robust(unseen_distance2_);
            continue;
        }
        cost += robust(r.squaredNorm());
        const double w = robust_weight(r.squaredNorm());
        const Matrix23d J_I = observation.sqrt_information * J_C * T_C_I.R;
        const Matrix23d J_X = J_I * I.R.transpose();
        eq.V[j].noalias() += w * J_X.transpose() * J_X;
        eq.b[j].noalias() += w * J_X.transpose() * r;
        if (i == 0 && first_pose_held) continue;
        Eigen::Matrix<double, 2, 6> J_pose;
        J_pose << J_I * so3::skew(p_I), -J_X;
        const int block = layout.pose_block(i);
        eq.matrix.block(block, block) += w * J_pose.transpose() * J_pose;
        eq.gradient.segment<6>(eq.matrix.offset(block)) += w * J_pose.transpose() * r;
        eq.W[k] = w * J_pose.transpose() * J_X;
        if (const int slot = layout.border_of_point[j]; slot >= 0)
            eq.matrix.block(layout.border_block(slot), block) += eq.W[k].transpose();
    }
    return cost;
}

double Objective::linearize_inertial(const State& state, NormalEquations& eq) const {
    const Layout& layout = eq.layout();
    const Eigen::Matrix3d J_gravity = gravity_jacobian(state.gravity);
    const int global = layout.global_block();
    double cost = 0;
    for (size_t i = 0; i < intervals_.size(); ++i) {
        const State::Frame &a = state.frames[i], &b = state.frames[i + 1];
        const Matrix9d& L = intervals_[i].sqrt_information;
        PreintegratedImu::Jacobian J;
        const Vector9d r =
            L * intervals_[i].readings.residual(a.motion, b.motion, a.bias, state.gravity, &J);
        cost += r.squaredNorm();

        // Columns of each block that the residual touches, whitened.
        struct Part {
            int block;
            Eigen::MatrixXd J;
        };
        Matrix9d Ji = L * J.state_i;
        if (i == 0 && !model_.surveyed()) Ji.leftCols<6>().setZero();
        const Matrix9d Jj = L * J.state_j;
        const Matrix96d Jb = L * J.bias;
        Eigen::MatrixXd motion_i(9, layout.motion_dim()), global_part(9, layout.global_dim());
        motion_i.leftCols<3>() = Ji.rightCols<3>();
        global_part.leftCols<3>() = L * J.gravity * J_gravity;
        if (layout.bias_per_frame)
            motion_i.rightCols<6>() = Jb;
        else
            global_part.rightCols<6>() = Jb;
        Eigen::MatrixXd motion_j = Eigen::MatrixXd::Zero(9, layout.motion_dim());
        motion_j.leftCols<3>() = Jj.rightCols<3>();
        const int fi = static_cast<int>(i);
        const Part parts[] = {{layout.pose_block(fi), Ji.leftCols<6>()},
                              {layout.motion_block(fi), motion_i},
                              {layout.pose_block(fi + 1), Jj.leftCols<6>()},
                              {layout.motion_block(fi + 1), motion_j},
                              {global, global_part}};
        for (const Part& row : parts) {
            eq.gradient.segment(eq.matrix.offset(row.block), row.J.cols()) += row.J.transpose() * r;
            for (const Part& col : parts)
                if (row.block >= col.block)
                    eq.matrix.block(row.block, col.block) += row.J.transpose() * col.J;
        }
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
    for (size_t i = 0; i < intervals_.size(); ++i)
        intervals_[i] = make_interval(static_cast<int>(i), state.frames[i].bias);
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
    // The gauge: without a survey the first pose defines W.
    if (!model_.surveyed())
        for (int k = 0; k < 6; ++k) equations.hold(equations.layout().index(0, k));
    if (model_.inertial && !stage_.gravity_free)
        equations.hold(equations.layout().gravity_index() + 2);
    return cost;
}

State Objective::apply(const State& state, const Step& step, const Layout& layout) const {
    State next = state;
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
    return next;
}

}  // namespace vio::batch
