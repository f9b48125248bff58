#include "libvio/recursive/start_at_rest.h"

#include <cmath>

#include "libvio/geometry/alignment.h"
#include "libvio/geometry/so3.h"
#include "libvio/recursive/body_frame.h"

namespace vio {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;

namespace {

constexpr double kRestVelocity = 0.01;  // [m/s], of what passes for rest
constexpr double kFirstTilt = 1.0;      // [rad], before gravity is seen
constexpr double kExact = 1e-6;         // [rad], [m], where the world begins

// The attitude without yaw whose z axis points along the specific force f_B.
Matrix3d levelled(const Vector3d& f_B) {
    const double roll = std::atan2(f_B.y(), f_B.z());
    const double pitch = std::atan2(-f_B.x(), std::hypot(f_B.y(), f_B.z()));
    return (Eigen::AngleAxisd(pitch, Vector3d::UnitY()) *
            Eigen::AngleAxisd(roll, Vector3d::UnitX()))
        .toRotationMatrix();
}

double squared(double x) {
    return x * x;
}

}  // namespace

BatchTail start_at_rest(const Stillness& rest, TimeNs t, const Rig& rig,
                        const BatchOptions& priors) {
    const ImuNoise& noise = rig.imu_noise;
    CoreState core;
    core.g_W = {0, 0, -priors.gravity_norm};
    core.gyro_bias = rest.gyro;
    core.T_W_I = Pose{levelled(rig.T_B_I.R * rest.accel), Vector3d::Zero()} * rig.T_B_I;

    // f = R^T (-g) + b + noise, in the errors (rotation in I, bias).
    const Matrix3d& R = core.T_W_I.R;
    const Vector3d predicted = R.transpose() * -core.g_W, up = R.transpose() * Vector3d::UnitZ();
    Eigen::Matrix<double, 3, 6> H;
    H << so3::skew(predicted), Matrix3d::Identity();
    Matrix6d information = Matrix6d::Zero();
    information.topLeftCorner<3, 3>() =
        Matrix3d::Identity() / squared(kFirstTilt) + up * up.transpose() / squared(kExact);
    information.bottomRightCorner<3, 3>() = Matrix3d::Identity() / squared(priors.accel_bias_sigma);
    const double weight = rest.seconds() / squared(noise.accel_noise_density);
    information += weight * H.transpose() * H;
    const Matrix6d C = information.inverse();
    const Vector6d d = C * (H.transpose() * (weight * (rest.accel - predicted)));
    core.T_W_I.R = R * so3::exp(d.head<3>());
    core.accel_bias = d.tail<3>();

    Matrix15d P = Matrix15d::Zero();
    P.block<3, 3>(kRotation, kRotation) = C.topLeftCorner<3, 3>();
    P.block<3, 3>(kRotation, kAccelBias) = C.topRightCorner<3, 3>();
    P.block<3, 3>(kAccelBias, kRotation) = C.bottomLeftCorner<3, 3>();
    P.block<3, 3>(kAccelBias, kAccelBias) = C.bottomRightCorner<3, 3>();
    P.diagonal().segment<3>(kPosition).setConstant(squared(kExact));
    P.diagonal().segment<3>(kVelocity).setConstant(squared(kRestVelocity));
    P.diagonal().segment<3>(kGyroBias).setConstant(squared(noise.gyro_noise_density) /
                                                   rest.seconds());
    BatchTail tail;
    Matrix15d J;
    tail.state = body_state(core, rig.T_B_I.inverse(), Vector3d::Zero(), &J);
    tail.state.t = t;
    // The world begins at the body, whose position therefore is exact.
    P = (J * P * J.transpose()).eval();
    P.middleRows<3>(kPosition).setZero();
    P.middleCols<3>(kPosition).setZero();
    P.diagonal().segment<3>(kPosition).setConstant(squared(kExact));
    tail.state.T_W_B.p.setZero();
    tail.state.covariance = 0.5 * (P + P.transpose());
    tail.covariance = tail.state.covariance;
    tail.g_W = core.g_W;
    return tail;
}

BatchTail continued(const BatchTail& start, const Pose& from, const StateEstimate& known) {
    const Similarity S = align_yaw_position(from, known.T_W_B);
    const Vector3d z = Vector3d::UnitZ(), origin = known.T_W_B.p;
    BatchTail tail = start;
    tail.state.T_W_B = S * start.state.T_W_B;
    tail.state.v_W = S.R * start.state.v_W;
    for (LandmarkEstimate& landmark : tail.landmarks) landmark.p_W = S * landmark.p_W;

    const Eigen::Index n = start.covariance.rows();
    MatrixXd turn = MatrixXd::Identity(n, n);
    for (Eigen::Index at = 0; at < n; at += 3)
        if (at == kPosition || at == kVelocity || at >= 15) turn.block<3, 3>(at, at) = S.R;
    // What all share: errors of yaw and position of the world in which they are now.
    MatrixXd shared = MatrixXd::Zero(n, 4);
    const auto moves = [&](Eigen::Index at, const Vector3d& p) {
        shared.block<3, 1>(at, 0) = z.cross(p - origin);
        shared.block<3, 3>(at, 1).setIdentity();
    };
    shared.block<3, 1>(kRotation, 0) = tail.state.T_W_B.R.transpose() * z;
    moves(kPosition, tail.state.T_W_B.p);
    shared.block<3, 1>(kVelocity, 0) = z.cross(tail.state.v_W);
    for (std::size_t i = 0; i < tail.landmarks.size(); ++i)
        moves(15 + 3 * static_cast<Eigen::Index>(i), tail.landmarks[i].p_W);
    Eigen::Matrix<double, 4, 6> M = Eigen::Matrix<double, 4, 6>::Zero();
    M.block<1, 3>(0, 0) = z.transpose() * known.T_W_B.R;
    M.block<3, 3>(1, 3).setIdentity();
    const Eigen::Matrix4d common = M * known.covariance.topLeftCorner<6, 6>() * M.transpose();
    tail.covariance = turn * start.covariance * turn.transpose();
    tail.covariance += shared * common * shared.transpose();
    tail.covariance = (0.5 * (tail.covariance + tail.covariance.transpose())).eval();
    tail.state.covariance = tail.covariance.topLeftCorner<15, 15>();
    for (std::size_t i = 0; i < tail.landmarks.size(); ++i) {
        const auto at = 15 + 3 * static_cast<Eigen::Index>(i);
        tail.landmarks[i].covariance = tail.covariance.block<3, 3>(at, at);
    }
    return tail;
}

}  // namespace vio
