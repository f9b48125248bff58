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
      loss_(stage.loss, options.loss_width),
      threads_(thread_count(options)),
      surveyed_(model.surveyed()),
      point_costs_(model.points.size(), 0.0),
      pose_sums_(kPieces) {
    const double diagonal = std::hypot(model.camera->width(), model.camera->height());
    largest_distance2_ = stage.truncated
                             ? diagonal * diagonal / (options.sigma_px * options.sigma_px)
                             : std::numeric_limits<double>::infinity();
    if (model.inertial)
        for (int i = 0; i + 1 < model.frames(); ++i) intervals_.push_back(make_interval(i, {}));
}

double Objective::prior_weight() const {
    // Eq. (12) multiplies the prior by the number of images, in keeping with the fixed variances; a
    // statistically weighted problem counts it once.
    return options_.weighting == "fixed" ? model_.frames() : 1;
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

Cost Objective::evaluate(const State& state) const {
    Cost cost = evaluate_rest(state);
    std::array<double, kPieces> parts{};
    const int observations = static_cast<int>(model_.observations.size());
    in_parallel(threads_, kPieces, [&](int piece) {
        for (int k = piece_begin(observations, kPieces, piece);
             k < piece_begin(observations, kPieces, piece + 1); ++k)
            if (const Observation& observation = model_.observations[k]; observation.active)
                parts[piece] += loss_.cost(observation_distance2(state, observation));
    });
    for (const double part : parts) cost.image += part;
    return cost;
}

Cost Objective::evaluate_rest(const State& state) const {
    std::array<double, kPieces> parts{};
    const int intervals = static_cast<int>(intervals_.size());
    in_parallel(threads_, kPieces, [&](int piece) {
        for (int i = piece_begin(intervals, kPieces, piece);
             i < piece_begin(intervals, kPieces, piece + 1); ++i)
            parts[piece] += interval_cost(state, i);
    });
    Cost cost;
    for (const double part : parts) cost.inertial += part;
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

// Image-only motion has no scale that deserves the name: cameras with one viewpoint see none, and
// where the rays of others start tells so little of it that noise decides. The distance of the
// image farthest from the first one is held.
void Objective::hold_scale(const State& state, NormalEquations& equations) const {
    const auto offset = [&](int i) -> Eigen::Vector3d {
        return state.frames[i].motion.p - state.frames[0].motion.p;
    };
    int farthest = 0;
    for (int i = 1; i < model_.frames(); ++i)
        if (offset(i).norm() > offset(farthest).norm()) farthest = i;
    const double distance = offset(farthest).norm();
    if (!(distance > 0)) return;
    const Eigen::Vector3d direction = offset(farthest) / distance;
    const double sigma = 1e-6 * distance;
    const int block = equations.layout().pose_block(farthest);
    equations.matrix.block(block, block).bottomRightCorner<3, 3>() +=
        direction * direction.transpose() / (sigma * sigma);
}

Cost Objective::linearize(const State& state, NormalEquations& equations) {
    reintegrate(state);
    equations.set_zero();
    Cost cost;
    cost.image = linearize_image(state, equations);
    cost.inertial = linearize_inertial(state, equations) + linearize_bias(state, equations);
    cost.prior = linearize_priors(state, equations);
    // A point that its images leave undetermined (no observation left, or rays without parallax)
    // stays where it is in the directions that they leave open.
    for (Eigen::Matrix3d& V : equations.V) {
        if (!undetermined(V)) continue;
        const double mean = V.trace() / 3;
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
    if (!model_.inertial && !model_.surveyed()) hold_scale(state, equations);
    if (model_.inertial && !stage_.gravity_free)
        equations.hold(equations.layout().gravity_index() + 2);
    return cost;
}

bool undetermined(const Eigen::Matrix3d& V) {
    const double mean = V.trace() / 3;
    return !(V.determinant() > 1e-12 * mean * mean * mean);
}

Eigen::Vector3d displaced(const Eigen::Vector3d& line, const Eigen::Vector3d& d) {
    const double range2 = line.squaredNorm();
    if (!(range2 > 0)) return line + d;
    const double growth = line.dot(d) / range2;
    constexpr double kLargestGrowth = 10;  // of the range; infinity is at the end of many steps
    return (line + d - growth * line) / std::max(1 / kLargestGrowth, 1 - growth);
}

Eigen::Vector3d Objective::moved_point(const State& state, const State& next, const Step& step,
                                       const Layout& layout, int j) const {
    const Eigen::Vector3d added = state.points[j] + step.points[j];
    if (model_.points[j].fiducial) return added;
    const int i = model_.observations[model_.points[j].first_observation].frame_idx;
    const InertialState &I = state.frames[i].motion, &moved = next.frames[i].motion;
    const auto part = [&](int component) {
        return step.reduced.segment<3>(layout.index(i, component));
    };
    // In the IMU frame: the sight line from the camera, and the point's motion, to first order.
    const Eigen::Vector3d p_I = I.R.transpose() * (state.points[j] - I.p),
                          line = p_I - model_.T_I_C.p,
                          d = I.R.transpose() * (step.points[j] - part(kPosition)) -
                              part(kRotation).cross(p_I);
    return moved.R * (model_.T_I_C.p + displaced(line, d)) + moved.p;
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
    in_parallel(threads_, kPieces, [&](int piece) {
        const int points = static_cast<int>(model_.points.size());
        for (int j = piece_begin(points, kPieces, piece);
             j < piece_begin(points, kPieces, piece + 1); ++j)
            next.points[j] = moved_point(state, next, step, layout, j);
    });
    if (model_.inertial) {
        const Eigen::Vector3d d = step.reduced.segment<3>(layout.gravity_index());
        if (stage_.gravity_free)
            next.gravity += d;
        else
            next.gravity = so3::exp(tangent_basis(state.gravity) * d.head<2>()) * state.gravity;
    }
}

}  // namespace vio::batch
