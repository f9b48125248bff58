// E_inertial, Eq. (4): what the readings between images, and the biases' drift, add to the error
// function.
#include <array>
#include <cmath>

#include "libvio/base/errors.h"
#include "libvio/batch/objective.h"
#include "libvio/batch/parallel.h"

namespace vio::batch {
namespace {

// Biases may move this far [rad/s], [m/s^2] from those that readings were integrated with: the
// correction is of first order, what it leaves out of second, below 1e-6 rad and 1e-5 m/s.
constexpr double kGyroBiasMove = 1e-3, kAccelBiasMove = 1e-2;

}  // namespace

Objective::Interval Objective::make_interval(int i, const ImuBias& bias) const {
    PreintegratedImu readings(model_.segments[i], bias, model_.interval_noise[i]);
    Matrix9d sqrt_information;
    if (options_.weighting == "fixed") {
        sqrt_information = Matrix9d::Identity() / std::sqrt(options_.fixed_variance);
    } else {
        const Eigen::LLT<Matrix9d> llt(readings.covariance());
        if (llt.info() != Eigen::Success)
            throw InputError("image (t = " + std::to_string(model_.times[i + 1]) +
                             " ns): the noise of the readings since the image before it gives no "
                             "covariance; are noise densities of the IMU zero?");
        sqrt_information = llt.matrixL().solve(Matrix9d::Identity());
    }
    return {readings, sqrt_information, bias};
}

Vector6d Objective::bias_walk_information(int i) const {
    const double T = to_seconds(model_.times[i + 1] - model_.times[i]);
    const double g = model_.noise.gyro_bias_random_walk, a = model_.noise.accel_bias_random_walk;
    Vector6d information;
    information << Eigen::Vector3d::Constant(1 / (g * g * T)),
        Eigen::Vector3d::Constant(1 / (a * a * T));
    return information;
}

void Objective::reintegrate(const State& state) {
    const int count = static_cast<int>(intervals_.size());
    in_parallel(threads_, kPieces, [&](int piece) {
        for (int i = piece_begin(count, kPieces, piece); i < piece_begin(count, kPieces, piece + 1);
             ++i) {
            const ImuBias &now = state.frames[i].bias, &then = intervals_[i].bias;
            if ((now.gyro - then.gyro).norm() > kGyroBiasMove ||
                (now.accel - then.accel).norm() > kAccelBiasMove)
                intervals_[i] = make_interval(i, now);
        }
    });
}

void Objective::readings_changed() {
    const int count = static_cast<int>(intervals_.size());
    in_parallel(threads_, kPieces, [&](int piece) {
        for (int i = piece_begin(count, kPieces, piece); i < piece_begin(count, kPieces, piece + 1);
             ++i)
            intervals_[i] = make_interval(i, intervals_[i].bias);
    });
}

double Objective::interval_cost(const State& state, int i) const {
    const State::Frame &a = state.frames[i], &b = state.frames[i + 1];
    const Vector9d r = intervals_[i].readings.residual(a.motion, b.motion, a.bias, state.gravity);
    double cost = (intervals_[i].sqrt_information * r).squaredNorm();
    if (options_.bias == "random_walk") {
        const Vector6d d = bias_vector(b.bias) - bias_vector(a.bias);
        cost += d.dot(bias_walk_information(i).cwiseProduct(d));
    }
    return cost;
}

Objective::IntervalRows Objective::interval_rows(const State& state, int i,
                                                 const Eigen::Matrix3d& J_gravity) const {
    const State::Frame &a = state.frames[i], &b = state.frames[i + 1];
    const Matrix9d& L = intervals_[i].sqrt_information;
    PreintegratedImu::Jacobian D;
    IntervalRows rows;
    rows.r = L * intervals_[i].readings.residual(a.motion, b.motion, a.bias, state.gravity, &D);
    rows.J.leftCols<9>().noalias() = L * D.state_i;
    if (i == 0 && !model_.surveyed()) rows.J.leftCols<6>().setZero();  // held
    rows.J.middleCols<6>(9).noalias() = L * D.bias;
    rows.J.middleCols<9>(15).noalias() = L * D.state_j;
    rows.J.rightCols<3>().noalias() = L * (D.gravity * J_gravity).eval();
    return rows;
}

double Objective::linearize_interval(const State& state, int i, const Eigen::Matrix3d& J_gravity,
                                     NormalEquations& eq, Matrix9d& global_H,
                                     Vector9d& global_g) const {
    const Layout& layout = eq.layout();
    const auto [r, J] = interval_rows(state, i, J_gravity);
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

}  // namespace vio::batch
