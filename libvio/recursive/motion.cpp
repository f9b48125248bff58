#include "libvio/recursive/motion.h"

#include <algorithm>
#include <cmath>

#include "libvio/base/angles.h"
#include "libvio/base/squared.h"
#include "libvio/geometry/so3.h"
#include "libvio/imu/integration.h"

namespace vio {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr int kInertial = static_cast<int>(CoreKind::inertial);
constexpr int kSmooth = static_cast<int>(CoreKind::smooth);
// Readings further apart than this do not describe the motion between them.
constexpr double kLargestGap = 0.1;          // [s]
constexpr double kUnseenAngularRate = 0.3;   // [rad/s], over the whole gap
constexpr double kUnseenAcceleration = 1.5;  // [m/s^2]
constexpr double kUnknownTurn = 1;           // [rad]; of a larger one nothing is known

// Adds to the covariance of an n-fold integrated random walk: x[0] is the walk (variance q per
// second), x[1] its integral, x[2] the integral of that.
void add_integrated_walk(CoreMatrix& noise, std::initializer_list<int> offsets, double q,
                         double dt) {
    constexpr double kFactorial[] = {1, 1, 2};
    int i = 0;
    for (const int a : offsets) {
        int j = 0;
        for (const int b : offsets) {
            const int power = i + j + 1;
            noise.block<3, 3>(a, b).diagonal().array() +=
                q * std::pow(dt, power) / (power * kFactorial[i] * kFactorial[j]);
            ++j;
        }
        ++i;
    }
}

class ImuDrivenMotion final : public MotionModel {
 public:
    explicit ImuDrivenMotion(const ImuNoise& noise) : noise_(noise) {}

    void advance(FilterState& state, const ImuReading& from, const ImuReading& to,
                 double interval) const override {
        const double dt = to_seconds(to.t - from.t);
        if (!(dt > 0)) return;
        const double gap = std::max(dt, interval);
        if (gap * kUnseenAngularRate > kUnknownTurn) return advance_unseen(state, dt, gap);
        CoreState core = state.core();
        const ImuSegment segment{dt, (from.gyro + to.gyro) / 2 - core.gyro_bias,
                                 (from.accel + to.accel) / 2 - core.accel_bias};
        InertialState moving{core.T_W_I.R, core.T_W_I.p, core.v_W};
        IntegrationJacobian J;
        integrate(moving, segment, core.g_W, &J);
        core.T_W_I = {moving.R, moving.p};
        core.v_W = moving.v;

        double gyro2 = noise_.gyro_density2(segment.gyro.norm());
        double accel2 = squared(noise_.accel_noise_density);
        // The same in sum, however many images divide the gap.
        if (gap > kLargestGap) {
            gyro2 += squared(kUnseenAngularRate) * gap;
            accel2 += squared(kUnseenAcceleration) * gap;
        }
        CoreMatrix transition = CoreMatrix::Identity(kInertial, kInertial);
        transition.topLeftCorner<9, 9>() = J.F;
        transition.block<9, 3>(0, kGyroBias) = -J.G_gyro;
        transition.block<9, 3>(0, kAccelBias) = -J.G_accel;
        CoreMatrix noise = CoreMatrix::Zero(kInertial, kInertial);
        noise.topLeftCorner<9, 9>() = white_noise(J, gyro2, accel2, dt);
        noise.diagonal().segment<3>(kGyroBias).setConstant(squared(noise_.gyro_bias_random_walk) *
                                                           dt);
        noise.diagonal()
            .segment<3>(kAccelBias)
            .setConstant(squared(noise_.accel_bias_random_walk) * dt);
        state.propagate(core, transition, noise);
    }

    void measure(FilterState&, const ImuReading&, double) const override {}

    FilterState start(const CoreState& mean, const Matrix15d& covariance, const ImuReading&,
                      bool invariant, CoreMatrix* lift) const override {
        *lift = CoreMatrix::Identity(kInertial, kInertial);
        return {CoreKind::inertial, mean, covariance, invariant};
    }

 private:
    // Where the body may have turned anyhow, a specific force tells nothing of the motion: it goes
    // on as it was, and that is ever less certain.
    void advance_unseen(FilterState& state, double dt, double gap) const {
        CoreState core = state.core();
        core.T_W_I.p += core.v_W * dt;
        CoreMatrix transition = CoreMatrix::Identity(kInertial, kInertial);
        transition.block<3, 3>(kPosition, kVelocity).diagonal().setConstant(dt);
        CoreMatrix noise = CoreMatrix::Zero(kInertial, kInertial);
        const double turn = std::min(kUnseenAngularRate * gap, kAnyAngle);
        add_integrated_walk(noise, {kRotation}, squared(turn) / gap, dt);
        add_integrated_walk(noise, {kVelocity, kPosition}, squared(kUnseenAcceleration) * gap, dt);
        add_integrated_walk(noise, {kGyroBias}, squared(noise_.gyro_bias_random_walk), dt);
        add_integrated_walk(noise, {kAccelBias}, squared(noise_.accel_bias_random_walk), dt);
        state.propagate(core, transition, noise);
    }

    ImuNoise noise_;
};

class SmoothMotion final : public MotionModel {
 public:
    SmoothMotion(const ImuNoise& noise, const SmoothnessVariances& variances, double gravity_sigma)
        : noise_(noise), variances_(variances), gravity_sigma_(gravity_sigma) {}

    void advance(FilterState& state, const ImuReading& from, const ImuReading& to,
                 double) const override {
        const double dt = to_seconds(to.t - from.t);
        if (!(dt > 0)) return;
        CoreState core = state.core();
        const Vector3d phi = core.omega_I * dt;
        core.T_W_I.p += core.v_W * dt + core.a_W * (dt * dt / 2);
        core.v_W += core.a_W * dt;
        core.T_W_I.R = so3::normalized(core.T_W_I.R * so3::exp(phi));

        CoreMatrix transition = CoreMatrix::Identity(kSmooth, kSmooth);
        transition.block<3, 3>(kRotation, kRotation) = so3::exp(-phi);
        transition.block<3, 3>(kRotation, kAngularRate) = so3::right_jacobian(phi) * dt;
        transition.block<3, 3>(kPosition, kVelocity).diagonal().setConstant(dt);
        transition.block<3, 3>(kPosition, kAcceleration).diagonal().setConstant(dt * dt / 2);
        transition.block<3, 3>(kVelocity, kAcceleration).diagonal().setConstant(dt);
        CoreMatrix noise = CoreMatrix::Zero(kSmooth, kSmooth);
        add_integrated_walk(noise, {kAngularRate, kRotation}, variances_.angular_rate, dt);
        add_integrated_walk(noise, {kAcceleration, kVelocity, kPosition}, variances_.acceleration,
                            dt);
        add_integrated_walk(noise, {kGyroBias}, squared(noise_.gyro_bias_random_walk), dt);
        add_integrated_walk(noise, {kAccelBias}, squared(noise_.accel_bias_random_walk), dt);
        state.propagate(core, transition, noise);
    }

    void measure(FilterState& state, const ImuReading& reading, double interval) const override {
        const double dt = std::clamp(interval, kShortestInterval, kLargestGap);
        state.update_core(
            [&](const CoreState& x, CoreRows* H, CoreResidual* residual) {
                Eigen::Matrix<double, 6, kSmooth> full;
                *residual = inertial_residual(x, reading, noise_, dt, &full);
                *H = full;
            },
            kIterations);
    }

    FilterState start(const CoreState& mean, const Matrix15d& covariance, const ImuReading& reading,
                      bool invariant, CoreMatrix* lift) const override {
        CoreState core = mean;
        core.omega_I = reading.gyro - mean.gyro_bias;
        core.a_W = mean.T_W_I.R * (reading.accel - mean.accel_bias) + mean.g_W;
        // omega = w' - b_w - n and a = R (a' - b_a - n) + g carry the errors of what they are
        // made from.
        const Vector3d specific_force = reading.accel - mean.accel_bias;
        CoreMatrix G = CoreMatrix::Zero(kSmooth, kSmooth);
        G.topLeftCorner<18, 18>().setIdentity();
        G.block<3, 3>(kAngularRate, kGyroBias) = -Matrix3d::Identity();
        G.block<3, 3>(kAcceleration, kRotation) = -mean.T_W_I.R * so3::skew(specific_force);
        G.block<3, 3>(kAcceleration, kAccelBias) = -mean.T_W_I.R;
        G.block<3, 3>(kAcceleration, kGravity).setIdentity();
        *lift = G.leftCols<kInertial>();
        CoreMatrix P = CoreMatrix::Zero(kSmooth, kSmooth);
        P.topLeftCorner<kInertial, kInertial>() = covariance;
        P.diagonal().segment<3>(kGravity).setConstant(squared(gravity_sigma_));
        P = (G * P * G.transpose()).eval();
        P.diagonal().segment<3>(kAngularRate).array() +=
            squared(noise_.gyro_noise_density) / kUsualInterval;
        P.diagonal().segment<3>(kAcceleration).array() +=
            squared(noise_.accel_noise_density) / kUsualInterval;
        return {CoreKind::smooth, core, P, invariant};
    }

 private:
    static constexpr int kIterations = 3;  // only the attitude makes it nonlinear
    static constexpr double kUsualInterval = 0.005, kShortestInterval = 1e-4;  // [s]

    ImuNoise noise_;
    SmoothnessVariances variances_;
    double gravity_sigma_;
};

class ImageOnlyMotion final : public MotionModel {
 public:
    explicit ImageOnlyMotion(const SmoothnessVariances& variances) : variances_(variances) {}

    void advance(FilterState& state, const ImuReading& from, const ImuReading& to,
                 double) const override {
        const double dt = to_seconds(to.t - from.t);
        if (!(dt > 0)) return;
        CoreMatrix noise = CoreMatrix::Zero(6, 6);
        noise.diagonal().head<3>().setConstant(variances_.image_rotation * dt);
        noise.diagonal().tail<3>().setConstant(variances_.image_position * dt);
        state.propagate(state.core(), CoreMatrix::Identity(6, 6), noise);
    }

    void measure(FilterState&, const ImuReading&, double) const override {}

    FilterState start(const CoreState& mean, const Matrix15d& covariance, const ImuReading&,
                      bool invariant, CoreMatrix* lift) const override {
        *lift = CoreMatrix::Identity(6, kInertial);
        return {CoreKind::pose, mean, covariance.topLeftCorner<6, 6>(), invariant};
    }

 private:
    SmoothnessVariances variances_;
};

}  // namespace

Vector9d rate_of(const CoreState& core, const ImuReading& reading) {
    Vector9d rate;
    rate << reading.gyro - core.gyro_bias, core.v_W,
        core.T_W_I.R * (reading.accel - core.accel_bias) + core.g_W;
    return rate;
}

Vector6d inertial_residual(const CoreState& core, const ImuReading& reading, const ImuNoise& noise,
                           double dt, Eigen::Matrix<double, 6, kSmooth>* H) {
    const double rate = reading.gyro.norm();  // the weight must not depend on the state
    const double gyro_scale = std::sqrt(dt / noise.gyro_density2(rate));
    const double accel_scale = std::sqrt(dt) / noise.accel_noise_density;
    const Matrix3d Rt = core.T_W_I.R.transpose();
    const Vector3d specific_force = Rt * (core.a_W - core.g_W);
    Vector6d residual;
    residual << gyro_scale * (reading.gyro - core.omega_I - core.gyro_bias),
        accel_scale * (reading.accel - specific_force - core.accel_bias);
    if (H) {
        H->setZero();
        H->block<3, 3>(0, kAngularRate) = gyro_scale * Matrix3d::Identity();
        H->block<3, 3>(0, kGyroBias) = gyro_scale * Matrix3d::Identity();
        H->block<3, 3>(3, kRotation) = accel_scale * so3::skew(specific_force);
        H->block<3, 3>(3, kAcceleration) = accel_scale * Rt;
        H->block<3, 3>(3, kGravity) = -accel_scale * Rt;
        H->block<3, 3>(3, kAccelBias) = accel_scale * Matrix3d::Identity();
    }
    return residual;
}

std::unique_ptr<MotionModel> make_imu_driven_motion(const ImuNoise& noise) {
    return std::make_unique<ImuDrivenMotion>(noise);
}

std::unique_ptr<MotionModel> make_smooth_motion(const ImuNoise& noise,
                                                const SmoothnessVariances& variances,
                                                double gravity_sigma) {
    return std::make_unique<SmoothMotion>(noise, variances, gravity_sigma);
}

std::unique_ptr<MotionModel> make_image_only_motion(const SmoothnessVariances& variances) {
    return std::make_unique<ImageOnlyMotion>(variances);
}

}  // namespace vio
