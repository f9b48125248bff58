#include "libvio/simulation/recorded.h"

#include <Eigen/Sparse>
#include <algorithm>
#include <cmath>

#include "libvio/base/errors.h"
#include "libvio/imu/preintegration.h"

namespace vio {
namespace {

using Eigen::Vector3d;

constexpr int kStateSize = 15;  // rotation, position, velocity, gyro bias, accelerometer bias

struct Node {
    InertialState state;  // of the IMU
    ImuBias bias;
};

// Body's state at t from the IMU's.
StateEstimate body_state(const Node& node, TimeNs t, const ImuReading& reading, const Pose& T_B_I) {
    const Pose T_I_B = T_B_I.inverse();
    StateEstimate body;
    body.t = t;
    body.T_W_B = Pose{node.state.R, node.state.p} * T_I_B;
    body.v_W = node.state.v + node.state.R * (reading.gyro - node.bias.gyro).cross(T_I_B.p);
    body.gyro_bias = node.bias.gyro;
    body.accel_bias = node.bias.accel;
    return body;
}

InertialState imu_state(const StateEstimate& body, const ImuReading& reading, const Pose& T_B_I) {
    const Pose T_W_I = body.T_W_B * T_B_I;
    const Vector3d omega_B = T_B_I.R * (reading.gyro - body.gyro_bias);
    return {T_W_I.R, T_W_I.p, body.v_W + body.T_W_B.R * omega_B.cross(T_B_I.p)};
}

std::vector<ImuSegment> segments_between(const ImuSequence& imu, TimeNs begin, TimeNs end) {
    const auto segments = imu.segments(begin, end);
    if (!segments)
        throw InputError("recorded IMU: no readings from " + std::to_string(to_seconds(begin)) +
                         " to " + std::to_string(to_seconds(end)) +
                         " s, where there are images; take fewer images or other times");
    return *segments;
}

// Sum of squared residuals, linearised: H x = -b over nodes and two angles of gravity.
class NormalEquations {
 public:
    explicit NormalEquations(int size) : size_(size), b_(Eigen::VectorXd::Zero(size)) {}

    /// Adds |r + sum J_k x[at_k]|^2 weighted by the information.
    template <typename Residual, typename Information>
    void add(const std::vector<std::pair<int, Eigen::MatrixXd>>& blocks, const Residual& r,
             const Information& information) {
        for (const auto& [row, J] : blocks) {
            const Eigen::MatrixXd weighted = J.transpose() * information;
            b_.segment(row, J.cols()) += weighted * r;
            for (const auto& [column, K] : blocks) {
                const Eigen::MatrixXd H = weighted * K;
                for (int i = 0; i < H.rows(); ++i)
                    for (int j = 0; j < H.cols(); ++j)
                        entries_.emplace_back(row + i, column + j, H(i, j));
            }
        }
    }

    Eigen::VectorXd solve() const {
        Eigen::SparseMatrix<double> H(size_, size_);
        H.setFromTriplets(entries_.begin(), entries_.end());
        const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> ldlt(H);
        return ldlt.solve(-b_);
    }

 private:
    int size_;
    Eigen::VectorXd b_;
    std::vector<Eigen::Triplet<double>> entries_;
};

class PathSmoother {
 public:
    PathSmoother(std::vector<Pose> measured, const std::vector<TimeNs>& times,
                 const ImuSequence& imu, const Rig& rig, double gravity,
                 const RecordedPathErrors& errors)
        : measured_(std::move(measured)), rig_(rig), errors_(errors), g_W_(0, 0, -gravity) {
        for (size_t i = 1; i < times.size(); ++i)
            segments_.push_back(segments_between(imu, times[i - 1] + from_seconds(rig.time_offset),
                                                 times[i] + from_seconds(rig.time_offset)));
    }

    int solve(std::vector<Node>& nodes) {
        constexpr int kMost = 30;
        for (int k = 1; k <= kMost; ++k)
            if (step(nodes) < 1e-7) return k;
        throw InputError(
            "recorded IMU: no motion agrees with both path and readings; do they belong together "
            "(times, units, IMU pose)?");
    }

    const Vector3d& g_W() const { return g_W_; }

 private:
    // Returns the largest change of a rotation [rad] or position [m].
    double step(std::vector<Node>& nodes) {
        const int gravity = kStateSize * static_cast<int>(nodes.size());
        NormalEquations equations(gravity + 2);
        for (size_t i = 0; i < nodes.size(); ++i) {
            add_pose(nodes, i, equations);
            if (i > 0) add_readings(nodes, i, gravity, equations);
        }
        const Eigen::VectorXd x = equations.solve();
        double largest = 0;
        for (size_t i = 0; i < nodes.size(); ++i) {
            const auto d = x.segment<kStateSize>(kStateSize * static_cast<Eigen::Index>(i));
            InertialState& s = nodes[i].state;
            s.R = so3::normalized(s.R * so3::exp(d.head<3>()));
            s.p += d.segment<3>(3);
            s.v += d.segment<3>(6);
            nodes[i].bias.gyro += d.segment<3>(9);
            nodes[i].bias.accel += d.segment<3>(12);
            largest = std::max(largest, d.head<6>().cwiseAbs().maxCoeff());
        }
        g_W_ = so3::exp({x[gravity], x[gravity + 1], 0}) * g_W_;
        return std::isfinite(largest) ? largest : 1;
    }

    void add_pose(const std::vector<Node>& nodes, size_t i, NormalEquations& equations) const {
        const InertialState& s = nodes[i].state;
        const Vector6d r = Pose{s.R, s.p}.boxminus(measured_[i]);
        Matrix6d J = Matrix6d::Identity();
        J.topLeftCorner<3, 3>() = so3::right_jacobian_inverse(r.head<3>());
        Vector6d weights;
        weights << Vector3d::Constant(1 / (errors_.rotation * errors_.rotation)),
            Vector3d::Constant(1 / (errors_.position * errors_.position));
        equations.add({{kStateSize * static_cast<int>(i), J}}, r, Matrix6d(weights.asDiagonal()));
    }

    // Readings and steps of the biases from node i - 1 to i.
    void add_readings(const std::vector<Node>& nodes, size_t i, int gravity,
                      NormalEquations& equations) const {
        const Node &a = nodes[i - 1], &b = nodes[i];
        const PreintegratedImu imu(segments_[i - 1], a.bias, rig_.imu_noise);
        PreintegratedImu::Jacobian J;
        const Vector9d r = imu.residual(a.state, b.state, a.bias, g_W_, &J);
        Eigen::MatrixXd Ja(9, kStateSize);
        Ja << J.state_i, J.bias;
        // g <- exp([x y 0]) g turns it by -skew(g) [x y 0].
        const Eigen::MatrixXd Jg = J.gravity * -so3::skew(g_W_).leftCols<2>();
        const int ia = kStateSize * static_cast<int>(i - 1), ib = ia + kStateSize;
        equations.add({{ia, Ja}, {ib, J.state_j}, {gravity, Jg}}, r,
                      Matrix9d(imu.covariance().inverse()));

        const ImuNoise& noise = rig_.imu_noise;
        const double gyro = noise.gyro_bias_random_walk, accel = noise.accel_bias_random_walk;
        Vector6d walk, weights;
        walk << b.bias.gyro - a.bias.gyro, b.bias.accel - a.bias.accel;
        weights << Vector3d::Constant(1 / (gyro * gyro)), Vector3d::Constant(1 / (accel * accel));
        const Matrix6d I = Matrix6d::Identity();
        equations.add({{ia + 9, -I}, {ib + 9, I}}, walk,
                      Matrix6d((weights / imu.duration()).asDiagonal()));
    }

    std::vector<Pose> measured_;  // T_W_I
    const Rig& rig_;
    RecordedPathErrors errors_;
    Vector3d g_W_;
    std::vector<std::vector<ImuSegment>> segments_;
};

}  // namespace

SmoothedPath smooth_path(const Trajectory& recorded, double t0_s, const std::vector<TimeNs>& times,
                         const ImuSequence& imu, const Rig& rig, double gravity,
                         const RecordedPathErrors& errors) {
    std::vector<Pose> measured;
    std::vector<Node> nodes;
    for (const TimeNs t : times) {
        const Motion motion =
            moved_to(recorded.at(t0_s + to_seconds(t - times.front())), rig.T_B_I);
        measured.push_back(motion.T_W_B);
        nodes.push_back({{motion.T_W_B.R, motion.T_W_B.p, motion.v_W}, {}});
    }
    PathSmoother smoother(measured, times, imu, rig, gravity, errors);
    SmoothedPath result;
    result.iterations = smoother.solve(nodes);

    double rotation2 = 0, position2 = 0;
    for (size_t i = 0; i < nodes.size(); ++i) {
        const Vector6d moved = Pose{nodes[i].state.R, nodes[i].state.p}.boxminus(measured[i]);
        rotation2 += moved.head<3>().squaredNorm();
        position2 += moved.tail<3>().squaredNorm();
    }
    result.rotation_rms = std::sqrt(rotation2 / static_cast<double>(nodes.size()));
    result.position_rms = std::sqrt(position2 / static_cast<double>(nodes.size()));

    const Eigen::Quaterniond upright =
        Eigen::Quaterniond::FromTwoVectors(smoother.g_W(), -Vector3d::UnitZ());
    result.tilt = Eigen::AngleAxisd(upright).angle();
    const Eigen::Matrix3d R = upright.toRotationMatrix();
    for (size_t i = 0; i < nodes.size(); ++i) {
        InertialState& s = nodes[i].state;
        s = {R * s.R, R * s.p, R * s.v};
        const auto reading = imu.interpolate(times[i] + from_seconds(rig.time_offset));
        result.states.push_back(body_state(nodes[i], times[i], reading.value(), rig.T_B_I));
    }
    return result;
}

std::vector<ImuConsistency> imu_consistency(const std::vector<StateEstimate>& truth,
                                            const ImuSequence& imu, const Rig& rig,
                                            const Vector3d& g_W, const std::vector<int>& strides) {
    const TimeNs offset = from_seconds(rig.time_offset);
    std::vector<ImuConsistency> results;
    for (const int stride : strides) {
        ImuConsistency result;
        Vector3d squares = Vector3d::Zero();
        for (size_t i = 0; i + stride < truth.size(); i += stride) {
            const StateEstimate &a = truth[i], &b = truth[i + stride];
            const auto segments = imu.segments(a.t + offset, b.t + offset);
            if (!segments) continue;
            const ImuBias bias{a.gyro_bias, a.accel_bias};
            const PreintegratedImu between(*segments, bias, rig.imu_noise);
            const auto state = [&](const StateEstimate& s) {
                return imu_state(s, imu.interpolate(s.t + offset).value(), rig.T_B_I);
            };
            const Vector9d r = between.residual(state(a), state(b), bias, g_W);
            result.nees += r.dot(between.covariance().ldlt().solve(r)) / 9;
            for (int k = 0; k < 3; ++k) squares[k] += r.segment<3>(3 * k).squaredNorm();
            result.window += between.duration();
            ++result.windows;
        }
        if (result.windows == 0) continue;
        result.nees /= result.windows;
        result.window /= result.windows;
        const Vector3d rms = (squares / result.windows).cwiseSqrt();
        result.rotation_rms = rms[0], result.position_rms = rms[1], result.velocity_rms = rms[2];
        results.push_back(result);
    }
    return results;
}

}  // namespace vio
