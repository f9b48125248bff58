#include "libvio/recursive/start_of_attitude.h"

#include <cmath>
#include <map>

#include "libvio/base/median.h"
#include "libvio/base/squared.h"
#include "libvio/geometry/so3.h"

namespace vio {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

constexpr double kMinShare = 0.5;  // of features in common
constexpr int kMinFeatures = 8;    // in common
constexpr int kRounds = 5;
constexpr double kMinSeconds = 1.0;  // of the images that rotation explains
// Of squared distances with two degrees of freedom: the median, and how far it may lie from it by
// chance (three standard deviations times the root of the number).
constexpr double kMedian = 1.39, kMedianSpreads = 4.3;

struct RayPair {
    Vector3d from, to;  // unit, in I
};

std::vector<RayPair> common_rays(const FeatureFrame& a, const FeatureFrame& b, const Rig& rig) {
    std::map<FeatureId, const FeatureObservation*> in_a;
    for (const FeatureObservation& f : a.features) in_a[f.feature_id] = &f;
    const Matrix3d R_I_C = rig.T_I_C().R;
    std::vector<RayPair> pairs;
    for (const FeatureObservation& f : b.features) {
        const auto before = in_a.find(f.feature_id);
        if (before == in_a.end()) continue;
        const auto from = rig.camera->ray(before->second->uv_px), to = rig.camera->ray(f.uv_px);
        if (from && to) pairs.push_back({R_I_C * from->direction, R_I_C * to->direction});
    }
    return pairs;
}

// Rotation about which rays turned, with its information for unit noise of the rays.
struct Turn {
    Matrix3d R;  // from the later frame to the earlier
    Matrix3d information;
    std::vector<double> distance2;  // of each ray [rad^2]
};

// Least squares with the weights of Cauchy's loss of the given width [rad].
Turn turn_between(const std::vector<RayPair>& pairs, const Matrix3d& first, double width) {
    Turn turn{first, Matrix3d::Zero(), {}};
    for (int round = 0; round < kRounds; ++round) {
        turn.information.setZero();
        turn.distance2.clear();
        Vector3d b = Vector3d::Zero();
        for (const RayPair& pair : pairs) {
            const Vector3d predicted = turn.R.transpose() * pair.from, d = pair.to - predicted;
            const double weight = 1 / (1 + d.squaredNorm() / (width * width));
            const Matrix3d J = so3::skew(predicted);  // of exp(-theta) predicted
            turn.information += weight * J.transpose() * J;
            b += weight * J.transpose() * d;
            turn.distance2.push_back(d.squaredNorm());
        }
        turn.R = turn.R * so3::exp(turn.information.ldlt().solve(b));
    }
    return turn;
}

// Rotation by the gyro over an interval and its derivative with respect to the bias; the mean of
// the rotations from the interval's end, and of the readings of the accelerometer turned by them.
struct Integrated {
    Matrix3d R = Matrix3d::Identity(), J_bias = Matrix3d::Zero(), mean_R = Matrix3d::Zero();
    Vector3d mean_force = Vector3d::Zero();
    double seconds = 0, variance = 0;  // of each component of the rotation [rad^2]
};

Integrated integrated_gyro(const std::vector<ImuSegment>& segments, const Vector3d& bias,
                           const ImuNoise& noise) {
    Integrated sum;
    for (const ImuSegment& segment : segments) {
        const Vector3d phi = (segment.gyro - bias) * segment.dt;
        const Matrix3d middle = sum.R * so3::exp(0.5 * phi), step = so3::exp(phi);
        sum.mean_R += middle * segment.dt;
        sum.mean_force += middle * segment.accel * segment.dt;
        sum.J_bias = (step.transpose() * sum.J_bias).eval();
        sum.J_bias -= so3::right_jacobian(phi) * segment.dt;
        sum.R = (sum.R * step).eval();
        sum.seconds += segment.dt;
        sum.variance += noise.gyro_density2(segment.gyro.norm()) * segment.dt;
    }
    sum.mean_R = (sum.R.transpose() * sum.mean_R / sum.seconds).eval();
    sum.mean_force = (sum.R.transpose() * sum.mean_force / sum.seconds).eval();
    return sum;
}

}  // namespace

std::optional<GyroBias> gyro_bias_of_rotation(const std::vector<FeatureFrame>& frames,
                                              const ImuSequence& imu, const Rig& rig,
                                              double sigma_px) {
    const TimeNs offset = from_seconds(rig.time_offset);
    const double ray_sigma = std::sqrt(2.0) * sigma_px * rig.camera->angular_resolution();
    const double walk2 = squared(rig.imu_noise.gyro_bias_random_walk);
    Matrix3d A = Matrix3d::Zero();
    Vector3d b = Vector3d::Zero();
    std::vector<double> distances2;
    double seconds = 0;
    for (std::size_t i = 0, j = 0; i + 1 < frames.size(); i = j) {
        std::vector<RayPair> pairs;
        for (j = i + 1; j < frames.size(); ++j) {
            std::vector<RayPair> longer = common_rays(frames[i], frames[j], rig);
            const auto enough = kMinShare * static_cast<double>(frames[i].features.size());
            if (static_cast<double>(longer.size()) < enough) break;
            pairs = std::move(longer);
        }
        j = std::max(i + 1, j - 1);
        const auto segments = imu.segments(frames[i].t + offset, frames[j].t + offset);
        if (!segments || static_cast<int>(pairs.size()) < kMinFeatures) continue;
        const Integrated gyro = integrated_gyro(*segments, Vector3d::Zero(), rig.imu_noise);
        const Turn turn = turn_between(pairs, gyro.R, 2 * ray_sigma);
        for (const double d2 : turn.distance2) distances2.push_back(d2 / squared(ray_sigma));
        const Matrix3d noise =
            squared(ray_sigma) * turn.information.inverse() +
            (gyro.variance + walk2 * std::pow(gyro.seconds, 3) / 3) * Matrix3d::Identity();
        const Matrix3d weighted = gyro.J_bias.transpose() * noise.inverse();
        A += weighted * gyro.J_bias;
        b += weighted * so3::log(gyro.R.transpose() * turn.R);
        seconds += gyro.seconds;
    }
    const double limit =
        kMedian * (1 + kMedianSpreads / std::sqrt(static_cast<double>(distances2.size())));
    if (seconds < kMinSeconds || !(median(distances2) < limit)) return std::nullopt;
    const Matrix3d covariance = A.inverse();
    return GyroBias{covariance * b, covariance};
}

AttitudeStart start_of_attitude(const std::vector<FeatureFrame>& frames, const ImuSequence& imu,
                                const GyroBias& gyro, const Rig& rig, const BatchOptions& priors) {
    constexpr double kVelocity_mps = 10;       // nothing is known of velocity
    constexpr double kVelocityChange_mps = 2;  // over the images
    const TimeNs offset = from_seconds(rig.time_offset);
    const TimeNs begin = frames.front().t + offset, end = frames.back().t + offset;
    const Integrated all =
        integrated_gyro(imu.segments(begin, end).value(), gyro.mean, rig.imu_noise);
    const double seconds = all.seconds, bias_variance = gyro.covariance.diagonal().maxCoeff();
    Felt felt;
    felt.force = all.mean_force;
    felt.bias_share = all.mean_R;
    felt.force_variance = squared(kVelocityChange_mps / seconds) +
                          squared(rig.imu_noise.accel_noise_density) / seconds +
                          squared(priors.gravity_norm * seconds / 2) * bias_variance;
    felt.gyro = gyro;
    felt.yaw_variance = bias_variance * squared(seconds) + all.variance;
    felt.velocity_variance = squared(kVelocity_mps);
    felt.position_variance = squared(kVelocity_mps * seconds);
    felt.position_velocity = squared(kVelocity_mps) * seconds;

    AttitudeStart start;
    start.tail = levelled(felt, frames.back().t, rig, priors);
    const auto rotated_from = [&](TimeNs t) -> Matrix3d {  // body at the end to body at t
        const auto rest = imu.segments(t + offset, end);
        if (t == frames.back().t || !rest) return Matrix3d::Identity();
        return rig.T_B_I.R * integrated_gyro(*rest, gyro.mean, rig.imu_noise).R *
               rig.T_B_I.R.transpose();
    };
    StateEstimate& last = start.tail.state;
    const Matrix3d first = last.T_W_B.R * rotated_from(frames.front().t).transpose();
    const double yaw = std::atan2(first(1, 0), first(0, 0));
    last.T_W_B.R = Eigen::AngleAxisd(-yaw, Vector3d::UnitZ()) * last.T_W_B.R;
    last.lost = true;
    for (const FeatureFrame& frame : frames) {
        start.states.push_back(last);
        start.states.back().t = frame.t;
        start.states.back().T_W_B.R = last.T_W_B.R * rotated_from(frame.t).transpose();
    }
    return start;
}

}  // namespace vio
