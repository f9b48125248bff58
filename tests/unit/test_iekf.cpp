// Pieces of the recursive estimator: Jacobians against central differences, order of messages.
#include <gtest/gtest.h>

#include <random>

#include "libvio/base/chi_square.h"
#include "libvio/recursive/body_frame.h"
#include "libvio/recursive/message_queue.h"
#include "libvio/recursive/motion.h"
#include "libvio/recursive/observation.h"
#include "tests/simulated_run.h"
#include "tests/unit/numeric_jacobian.h"

namespace vio {
namespace {

using Eigen::Vector3d;
using test::numeric_jacobian;

template <int N>
Eigen::Matrix<double, N, 1> random_vector(std::mt19937& random, double scale) {
    std::normal_distribution<double> normal;
    Eigen::Matrix<double, N, 1> v;
    for (int i = 0; i < N; ++i) v(i) = scale * normal(random);
    return v;
}

CoreState some_core(std::mt19937& random) {
    CoreState core;
    core.T_W_I = {so3::exp(random_vector<3>(random, 1.0)), random_vector<3>(random, 2.0)};
    core.v_W = random_vector<3>(random, 1.0);
    core.gyro_bias = random_vector<3>(random, 0.05);
    core.accel_bias = random_vector<3>(random, 0.2);
    core.g_W = {0, 0, -9.81};
    core.omega_I = random_vector<3>(random, 1.0);
    core.a_W = random_vector<3>(random, 2.0);
    return core;
}

/// other [-] core, in the order of the core's errors.
Eigen::Matrix<double, kMaxCore, 1> difference(const CoreState& core, const CoreState& other) {
    Eigen::Matrix<double, kMaxCore, 1> d;
    d << other.T_W_I.boxminus(core.T_W_I), other.v_W - core.v_W, other.gyro_bias - core.gyro_bias,
        other.accel_bias - core.accel_bias, other.g_W - core.g_W, other.omega_I - core.omega_I,
        other.a_W - core.a_W;
    return d;
}

TEST(IekfObservation, JacobiansMatchDifferences) {
    std::mt19937 random(3);
    const Rig rig = test::simulate_run({.seconds = 0.2}).rig;
    const Pose T_C_I = rig.T_I_C().inverse();
    FeatureObservation feature;
    feature.uv_px = {300, 200};
    feature.covariance_shape << 2, 0.5, 0.5, 1;
    const Sight sight = *make_sight(feature, 0.7);
    EXPECT_LT((sight.whitening * (0.49 * feature.covariance_shape) * sight.whitening.transpose() -
               Eigen::Matrix2d::Identity())
                  .norm(),
              1e-12);
    for (int i = 0; i < 20; ++i) {
        const Pose T_W_I{so3::exp(random_vector<3>(random, 1.0)), random_vector<3>(random, 1.0)};
        const Vector3d p_C = Vector3d(0, 0, 4) + random_vector<3>(random, 0.7);
        const Vector3d p_W = T_W_I * (T_C_I.inverse() * p_C);
        const auto at = sight_residual(*rig.camera, T_C_I, T_W_I, p_W, sight);
        ASSERT_TRUE(at);
        const auto prediction = [&](const Eigen::Matrix<double, 15, 1>& d) -> Eigen::Vector2d {
            const Pose T_I_C = T_C_I.inverse().boxplus(d.tail<6>());
            return -sight_residual(*rig.camera, T_I_C.inverse(), T_W_I.boxplus(d.head<6>()),
                                   p_W + d.segment<3>(6), sight)
                        ->residual;
        };
        Eigen::Matrix<double, 2, 15> J;
        J << at->J_rotation, at->J_position, at->J_point, at->J_camera;
        const auto numeric = numeric_jacobian<2, 15>(prediction);
        EXPECT_LT((J - numeric).norm(), 1e-6 * numeric.norm());
    }
}

// Where a point is, and what becomes of it at another anchor, with the errors of both anchors and
// of the camera's place on the IMU.
TEST(IekfAnchoredPoint, JacobiansMatchDifferences) {
    std::mt19937 random(6);
    const auto some_pose = [&] {
        return Pose{so3::exp(random_vector<3>(random, 0.5)), random_vector<3>(random, 0.5)};
    };
    for (int i = 0; i < 20; ++i) {
        const Pose from = some_pose(), to = some_pose(), T_I_C = some_pose();
        AnchoredPoint point = anchored(from * (T_I_C * Vector3d(0.2, -0.3, 4)), from, T_I_C);
        point.x += random_vector<3>(random, 0.05);
        const auto place = [&](const Eigen::Matrix<double, 15, 1>& d) -> Vector3d {
            AnchoredPoint moved = point;
            moved.x += d.segment<3>(6);
            return placed(moved, from.boxplus(d.head<6>()), T_I_C.boxplus(d.tail<6>())).p_W;
        };
        const PlacedPoint at = placed(point, from, T_I_C);
        Eigen::Matrix<double, 3, 15> J;
        J << at.J_rotation, Eigen::Matrix3d::Identity(), at.J_point, at.J_camera;
        const auto numeric = numeric_jacobian<3, 15>(place);
        EXPECT_LT((J - numeric).norm(), 1e-6 * numeric.norm());

        const MovedPoint moved = moved_anchor(point, from, to, T_I_C);
        const auto seen_from_other = [&](const Eigen::Matrix<double, 21, 1>& d) -> Vector3d {
            AnchoredPoint other = point;
            other.x += d.segment<3>(12);
            const Pose mount = T_I_C.boxplus(d.tail<6>());
            const Vector3d p_C = (to.boxplus(d.segment<6>(6)) * mount).inverse() *
                                 placed(other, from.boxplus(d.head<6>()), mount).p_W;
            const Vector3d direction = moved.point.Q.transpose() * p_C;
            return {direction.x() / direction.z(), direction.y() / direction.z(),
                    1 / direction.z()};
        };
        Eigen::Matrix<double, 3, 21> J_moved;
        J_moved << moved.J_from, moved.J_to, moved.J_point, moved.J_camera;
        const auto numeric_moved = numeric_jacobian<3, 21>(seen_from_other);
        EXPECT_LT((J_moved - numeric_moved).norm(), 1e-6 * numeric_moved.norm());
    }
}

TEST(IekfMotion, InertialMeasurementMatchesDifferences) {
    std::mt19937 random(4);
    const CoreState core = some_core(random);
    const ImuReading reading{0, random_vector<3>(random, 1.0), random_vector<3>(random, 9.0)};
    const ImuNoise noise;
    Eigen::Matrix<double, 6, kMaxCore> H;
    inertial_residual(core, reading, noise, 0.005, &H);
    const auto numeric =
        numeric_jacobian<6, kMaxCore>([&](const Eigen::Matrix<double, kMaxCore, 1>& d) -> Vector6d {
            return -inertial_residual(FilterState::moved(core, d), reading, noise, 0.005, nullptr);
        });
    EXPECT_LT((H - numeric).norm(), 1e-7 * numeric.norm());
}

// The transition F is seen through the covariance: F A F^T is what A adds to it.
void check_transition(const MotionModel& motion, CoreKind kind) {
    std::mt19937 random(5);
    const int n = static_cast<int>(kind);
    for (int trial = 0; trial < 5; ++trial) {
        const CoreState core = some_core(random);
        const ImuReading from{0, random_vector<3>(random, 1.0), random_vector<3>(random, 9.0)};
        const ImuReading to{10'000'000, random_vector<3>(random, 1.0),
                            random_vector<3>(random, 9.0)};
        CoreMatrix A = CoreMatrix::Zero(n, n);
        for (int i = 0; i < n; ++i) {
            const Eigen::VectorXd a = random_vector<kMaxCore>(random, 1.0).head(n);
            A += a * a.transpose();
        }
        const auto moved_covariance = [&](const CoreMatrix& P) {
            FilterState state(kind, core, P, true);
            motion.advance(state, from, to);
            return state.core_covariance();
        };
        const CoreMatrix added = moved_covariance(A) - moved_covariance(CoreMatrix::Zero(n, n));

        const auto end = [&](const Eigen::VectorXd& d) {
            FilterState state(kind, FilterState::moved(core, d), CoreMatrix::Zero(n, n), true);
            motion.advance(state, from, to);
            return state.core();
        };
        const CoreState middle = end(Eigen::VectorXd::Zero(n));
        const auto F = numeric_jacobian<kMaxCore, kMaxCore>(
            [&](const Eigen::Matrix<double, kMaxCore, 1>& d) -> Eigen::Matrix<double, kMaxCore, 1> {
                return difference(middle, end(d.head(n)));
            });
        const CoreMatrix numeric = F.topLeftCorner(n, n) * A * F.topLeftCorner(n, n).transpose();
        EXPECT_LT((added - numeric).norm(), 1e-6 * numeric.norm());
    }
}

TEST(IekfMotion, TransitionsMatchDifferences) {
    check_transition(*make_imu_driven_motion({}), CoreKind::inertial);
    check_transition(*make_smooth_motion({}, {}, 0.1), CoreKind::smooth);
}

TEST(IekfBodyFrame, JacobianMatchesDifferencesAndInverseReturns) {
    std::mt19937 random(6);
    const CoreState core = some_core(random);
    const Pose T_I_B{so3::exp({0.3, -0.4, 0.5}), {0.2, -0.1, 0.3}};
    const Vector3d gyro(0.5, -1, 0.8);
    Matrix15d J;
    const StateEstimate body = body_state(core, T_I_B, gyro - core.gyro_bias, &J);
    const auto numeric = numeric_jacobian<15, 15>([&](const Eigen::Matrix<double, 15, 1>& d) {
        const CoreState x = FilterState::moved(core, d);
        const StateEstimate b = body_state(x, T_I_B, gyro - x.gyro_bias);
        Eigen::Matrix<double, 15, 1> e;
        e << b.T_W_B.boxminus(body.T_W_B), b.v_W - body.v_W, b.gyro_bias - body.gyro_bias,
            b.accel_bias - body.accel_bias;
        return e;
    });
    EXPECT_LT((J - numeric).norm(), 1e-7 * J.norm());
    const CoreState back = imu_state(body, T_I_B.inverse(), gyro - core.gyro_bias);
    EXPECT_LT(difference(core, back).head<15>().norm(), 1e-12);
}

// What a turn of the world leaves unknown of the velocity is not counted, all else is: against
// samples.
TEST(IekfBodyFrame, UncertaintyOfVelocityIsThatInTheBody) {
    std::mt19937 random(6);
    const CoreState core = some_core(random);
    const Eigen::Matrix3d R = core.T_W_I.R;
    const Vector3d v = 20 * core.v_W, up = Vector3d::UnitZ();
    Eigen::Matrix<double, 9, 1> turn = Eigen::Matrix<double, 9, 1>::Zero();
    turn << R.transpose() * up, up.cross(core.T_W_I.p), up.cross(v);
    Matrix9d P = turn * turn.transpose();
    EXPECT_LT(velocity_sigma(R, v, P), 1e-6);  // the root of what rounding leaves
    P += (Eigen::Matrix<double, 9, 1>() << 1e-6, 4e-6, 9e-6, 1, 1, 1, 1e-4, 4e-4, 9e-4)
             .finished()
             .asDiagonal();
    const Matrix9d L = P.llt().matrixL();
    Vector3d sum = Vector3d::Zero();
    constexpr int kSamples = 20000;
    for (int i = 0; i < kSamples; ++i) {
        const Eigen::Matrix<double, 9, 1> d = 1e-5 * L * random_vector<9>(random, 1.0);
        const Vector3d there =
            (R * so3::exp(d.head<3>())).transpose() * (v + d.tail<3>()) - R.transpose() * v;
        sum += 1e10 * there.cwiseAbs2();
    }
    const double sampled = std::sqrt(sum.maxCoeff() / kSamples);
    EXPECT_NEAR(velocity_sigma(R, v, P), sampled, 4 * sampled / std::sqrt(2.0 * kSamples));
}

// No covariance along the inverse distance, which the rows see only where the first iteration has
// led to.
TEST(IekfState, AFailedUpdateChangesNothing) {
    std::mt19937 random(7);
    FilterState state(CoreKind::inertial, some_core(random), CoreMatrix::Identity(15, 15) * 1e-2,
                      true);
    state.clone(1);
    LandmarkState landmark;
    landmark.anchor = state.find_clone(1);
    landmark.point.x = {0.1, 0.2, 0.5};
    state.augment({landmark}, Eigen::MatrixXd::Zero(3, state.window_size()),
                  Vector3d(1e-2, 1e-2, -1e-2).asDiagonal());
    const Eigen::MatrixXd before = state.covariance();
    int calls = 0;
    const auto linearise = [&](const Eigen::VectorXd&, std::vector<PointRows>* rows) {
        PointRows row;
        row.landmark_idx = row.slot = 0;
        row.J_pose.setOnes();
        row.J_anchor.setOnes();
        row.J_landmark.setOnes();
        row.J_landmark.col(2).setConstant(++calls > 1 ? 100 : 0);
        row.residual = {1, 10.0 * calls};
        *rows = {row};
    };
    EXPECT_EQ(state.update(linearise, 3), 0);
    EXPECT_GT(calls, 1);
    EXPECT_EQ(state.take_innovations().dof, 0);
    EXPECT_EQ((state.covariance() - before).norm(), 0);
}

TEST(IekfChiSquare, QuantilesMatchTables) {
    EXPECT_NEAR(chi_square_quantile(2, 0.99), 9.210, 0.03 * 9.210);
    EXPECT_NEAR(chi_square_quantile(10, 0.95), 18.307, 0.01 * 18.307);
    EXPECT_NEAR(chi_square_quantile(19, 0.999), 43.820, 0.01 * 43.820);
}

ImuReading reading_at(TimeNs t) {
    ImuReading reading;
    reading.t = t;
    return reading;
}

// An image waits for readings, but not for ever.
TEST(IekfMessageQueue, DoesWithoutReadingsAfterAWhile) {
    MessageQueue<> queue(0, true);
    const TimeNs wait = MessageQueue<>::kLongestWait;
    queue.add(reading_at(0));
    EXPECT_TRUE(queue.pop(false));
    queue.add(TimedFrame{10, {}});
    EXPECT_FALSE(queue.pop(false));
    queue.add(TimedFrame{10 + wait, {}});
    EXPECT_TRUE(queue.pop(false));
    EXPECT_FALSE(queue.pop(false));
    EXPECT_TRUE(queue.add(reading_at(20)));  // later than what was released
}

TEST(IekfMessageQueue, OrdersWithinItsWindowAndCountsTheRest) {
    MessageQueue<> queue(100, true);
    EXPECT_TRUE(queue.add(reading_at(10)));
    EXPECT_TRUE(queue.add(reading_at(30)));
    EXPECT_TRUE(queue.add(reading_at(20)));
    EXPECT_FALSE(queue.add(reading_at(20)));  // twice
    EXPECT_TRUE(queue.add(reading_at(140)));
    EXPECT_TRUE(queue.add(TimedFrame{25, {}}));  // late, but within the window
    std::vector<TimeNs> times;
    const auto time = [](const auto& m) -> TimeNs {
        if constexpr (std::is_same_v<std::decay_t<decltype(m)>, ImuReading>)
            return m.t;
        else
            return m.t_imu;
    };
    while (const auto message = queue.pop(false)) times.push_back(std::visit(time, *message));
    EXPECT_EQ(times, (std::vector<TimeNs>{10, 20, 25, 30}));
    EXPECT_FALSE(queue.add(reading_at(15)));  // too late
    EXPECT_EQ(queue.late(), 1);
    EXPECT_EQ(queue.repeated(), 1);
    times.clear();
    while (const auto message = queue.pop(true)) times.push_back(std::visit(time, *message));
    EXPECT_EQ(times, (std::vector<TimeNs>{140}));
}

}  // namespace
}  // namespace vio
