// The recursive estimator: equal to the information solution on linear problems; global position
// and rotation about gravity stay unobserved; same input, same bytes; covariance stays a
// covariance.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <random>

#include "libvio/recursive/iekf.h"
#include "libvio/recursive/landmark_update.h"
#include "libvio/recursive/motion.h"
#include "libvio/recursive/window.h"
#include "tests/simulated_run.h"

namespace vio {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

MatrixXd random_matrix(std::mt19937& random, int rows, int columns) {
    std::normal_distribution<double> normal;
    MatrixXd m(rows, columns);
    for (int j = 0; j < columns; ++j)
        for (int i = 0; i < rows; ++i) m(i, j) = normal(random);
    return m;
}

MatrixXd random_covariance(std::mt19937& random, int n) {
    const MatrixXd a = random_matrix(random, n, n);
    return a * a.transpose() / n + 0.1 * MatrixXd::Identity(n, n);
}

/// A state with three clones and four landmarks, linear where errors are small.
FilterState some_state(std::mt19937& random, CoreKind kind, bool invariant) {
    const int c = static_cast<int>(kind);
    CoreState core;
    core.T_W_I = {so3::exp({0.3, -0.2, 0.9}), {1, 2, 0.5}};
    core.g_W = {0, 0, -9.81};
    FilterState state(kind, core, random_covariance(random, c), invariant);
    const bool mounted = kind == CoreKind::inertial;
    state.start_mount({}, mounted ? random_covariance(random, kMountSize) : MatrixXd());
    state.clone(0);
    std::vector<LandmarkState> landmarks(4);
    for (LandmarkState& landmark : landmarks) {
        landmark.anchor = 0;
        landmark.point.x = {0.1, -0.2, 0.4};
    }
    state.start_landmarks(landmarks, random_covariance(random, state.window_size() + 12));
    for (int i = 0; i < 3; ++i) {
        if (i > 0) state.clone(i, 0.1 * random_matrix(random, 6, 1));
        const CoreMatrix F = CoreMatrix::Identity(c, c) + 0.1 * random_matrix(random, c, c);
        state.propagate(state.core(), F, random_covariance(random, c));
        state.settle();
    }
    return state;
}

/// The same with as many landmarks as asked for, anchored in all clones.
FilterState state_of_landmarks(std::mt19937& random, bool invariant, int count) {
    FilterState state = some_state(random, CoreKind::inertial, invariant);
    state.marginalise({true, true, true, true});
    std::vector<LandmarkState> landmarks(count);
    for (int i = 0; i < count; ++i) {
        landmarks[i].anchor = i % 3;
        landmarks[i].point.x = {0.1, -0.2, 0.4};
    }
    state.start_landmarks(landmarks, random_covariance(random, state.window_size() + 3 * count));
    return state;
}

PointRows random_rows(std::mt19937& random, int landmark_idx, double residual) {
    PointRows rows;
    rows.landmark_idx = landmark_idx;
    rows.slot = 2;
    rows.residual = residual * random_matrix(random, 2, 1);
    rows.J_pose = random_matrix(random, 2, 6);
    rows.J_anchor = random_matrix(random, 2, 6);
    rows.J_camera = random_matrix(random, 2, 6);
    rows.J_landmark = random_matrix(random, 2, 3);
    return rows;
}

TEST(IekfLinear, UpdateEqualsInformationSolution) {
    std::mt19937 random(1);
    FilterState state = some_state(random, CoreKind::inertial, false);
    const MatrixXd P = state.covariance();
    const int w = state.window_size(), n = state.size();
    MatrixXd H = MatrixXd::Zero(20, n);
    H.leftCols(w) = random_matrix(random, 20, w);
    const VectorXd r = 1e-6 * random_matrix(random, 20, 1);
    const Vector3d p = state.landmarks()[1].point.x;
    state.update(H.leftCols(w), r);
    const MatrixXd expected = (P.inverse() + H.transpose() * H).inverse();
    EXPECT_LT((state.covariance() - expected).norm(), 1e-9 * expected.norm());
    const VectorXd delta = expected * H.transpose() * r;
    EXPECT_LT(
        (state.landmarks()[1].point.x - p - delta.segment<3>(state.landmark_offset(1))).norm(),
        1e-9 * delta.norm());
}

// More rows than reduce the covariance at once.
TEST(IekfLinear, LandmarkUpdateEqualsInformationSolution) {
    constexpr int kLandmarks = 75;
    std::mt19937 random(4);
    FilterState state = state_of_landmarks(random, false, kLandmarks);
    const MatrixXd P = state.covariance();
    std::vector<PointRows> rows;
    MatrixXd H = MatrixXd::Zero(2 * kLandmarks, state.size());
    VectorXd r(2 * kLandmarks);
    for (int i = 0; i < kLandmarks; ++i) {
        const PointRows row = random_rows(random, (7 * i) % kLandmarks, 1e-6);  // in no order
        const int anchor = state.landmarks()[row.landmark_idx].anchor;
        H.block<2, 6>(2 * i, state.clone_offset(row.slot)) = row.J_pose;
        H.block<2, 6>(2 * i, state.clone_offset(anchor)) += row.J_anchor;
        H.block<2, 6>(2 * i, state.mount_offset()) = row.J_camera;
        H.block<2, 3>(2 * i, state.landmark_offset(row.landmark_idx)) = row.J_landmark;
        r.segment<2>(2 * i) = row.residual;
        rows.push_back(row);
    }
    const Vector3d p = state.landmarks()[60].point.x;
    state.update([&](const VectorXd&, std::vector<PointRows>* out) { *out = rows; }, 1);
    const MatrixXd expected = (P.inverse() + H.transpose() * H).inverse();
    EXPECT_LT((state.covariance() - expected).norm(), 1e-9 * expected.norm());
    EXPECT_EQ(MatrixXd(state.covariance()), MatrixXd(state.covariance().transpose()));
    const VectorXd delta = expected * H.transpose() * r;
    EXPECT_LT(
        (state.landmarks()[60].point.x - p - delta.segment<3>(state.landmark_offset(60))).norm(),
        1e-9 * delta.norm());
}

// In one order or the other: the rows reduce the covariance some at a time, and what a large
// innovation changes in the errors' sensitivity to scale is carried through all of them.
TEST(IekfUpdate, DoesNotDependOnTheOrderOfItsRows) {
    constexpr int kLandmarks = 75;
    std::mt19937 random(5);
    FilterState one = state_of_landmarks(random, true, kLandmarks);
    std::vector<PointRows> rows;
    for (int i = 0; i < kLandmarks; ++i) rows.push_back(random_rows(random, i, 1));
    FilterState other = one;
    const auto update = [&](FilterState& state) {
        return state.update([&](const VectorXd&, std::vector<PointRows>* out) { *out = rows; }, 2);
    };
    EXPECT_EQ(update(one), 2);
    std::reverse(rows.begin(), rows.end());
    EXPECT_EQ(update(other), 2);
    const MatrixXd P = one.covariance();
    EXPECT_LT((P - other.covariance()).norm(), 1e-9 * P.norm());
    for (int i = 0; i < kLandmarks; ++i) {
        const Vector3d x = one.landmarks()[i].point.x;
        EXPECT_LT((x - other.landmarks()[i].point.x).norm(), 1e-9 * x.norm()) << i;
    }
}

// Scale about the world's origin: how positions, velocity and inverse distances change with it.
VectorXd change_of_scale(const FilterState& state) {
    VectorXd n = VectorXd::Zero(state.size());
    n.segment<3>(kPosition) = state.core().T_W_I.p;
    n.segment<3>(kVelocity) = state.core().v_W;
    for (int i = 0; i < static_cast<int>(state.clones().size()); ++i)
        n.segment<3>(state.clone_offset(i) + kPosition) = state.clones()[i].T_W_I.p;
    for (int i = 0; i < static_cast<int>(state.landmarks().size()); ++i)
        n(state.landmark_offset(i) + 2) = -state.landmarks()[i].point.x.z();
    return n;
}

// Where only the scale of path and points is uncertain, that is so after a correction of it, too.
TEST(IekfUpdate, PathAndPointsKeepOneScale) {
    constexpr double kScaleSigma = 0.1, kElse = 1e-5, kMeasured = 0.02, kOff = 0.08;
    const int c = static_cast<int>(CoreKind::inertial);
    CoreState core;
    core.T_W_I = {so3::exp({0.3, -0.2, 0.9}), {1, 2, 0.5}};
    core.g_W = {0, 0, -9.81};
    core.v_W = {0.3, -0.1, 0.2};
    const CoreMatrix known = kElse * kElse * CoreMatrix::Identity(c, c);
    FilterState state(CoreKind::inertial, core, known, true);
    state.start_mount({}, MatrixXd());
    state.clone(0);
    std::vector<LandmarkState> landmarks(4);
    for (LandmarkState& landmark : landmarks) {
        landmark.anchor = 0;
        landmark.point.x = {0.1, -0.2, 0.4};
    }
    const Eigen::Index size = state.size() + 12;
    VectorXd n = VectorXd::Zero(size);
    n.head(state.size()) = change_of_scale(state);
    for (Eigen::Index i = state.size() + 2; i < size; i += 3) n(i) = -landmarks[0].point.x.z();
    state.start_landmarks(landmarks, kElse * kElse * MatrixXd::Identity(size, size) +
                                         kScaleSigma * kScaleSigma * n * n.transpose());
    MatrixXd H = MatrixXd::Zero(1, state.window_size());
    H.block<1, 3>(0, kVelocity) = core.v_W.transpose() / core.v_W.squaredNorm() / kMeasured;
    state.update(H, VectorXd::Constant(1, kOff / kMeasured));
    const double gain = 1 / (1 + kMeasured * kMeasured / (kScaleSigma * kScaleSigma));
    EXPECT_LT((state.core().T_W_I.p - (1 + gain * kOff) * core.T_W_I.p).norm(), 1e-4);
    // To second order, too: inverse distances are divided by what positions are multiplied with.
    for (const LandmarkState& landmark : state.landmarks())
        EXPECT_NEAR(landmark.point.x.z() * (1 + gain * kOff), landmarks[0].point.x.z(), 1e-4);
    const VectorXd after = change_of_scale(state);
    const MatrixXd expected = gain * kMeasured * kMeasured * after * after.transpose();
    EXPECT_LT((state.covariance() - expected).norm(), 1e-3 * expected.norm());
}

TEST(IekfLinear, LazyCoreEqualsWholeState) {
    std::mt19937 random(2);
    FilterState state = some_state(random, CoreKind::smooth, false);
    const int c = state.core_size(), n = state.size();
    MatrixXd P = state.covariance();
    VectorXd mean = VectorXd::Zero(n);
    const Vector3d before = state.landmarks()[2].point.x;
    for (int step = 0; step < 5; ++step) {
        const MatrixXd F = MatrixXd::Identity(c, c) + 0.05 * random_matrix(random, c, c);
        const MatrixXd Q = 0.01 * random_covariance(random, c);
        const MatrixXd H = random_matrix(random, 6, c);
        const VectorXd r = 1e-7 * random_matrix(random, 6, 1);
        state.propagate(state.core(), F, Q);
        state.update_core(
            [&](const CoreState&, CoreRows* rows, CoreResidual* residual) {
                *rows = H;
                *residual = r;
            },
            1);
        MatrixXd whole = MatrixXd::Identity(n, n);
        whole.topLeftCorner(c, c) = F;
        P = (whole * P * whole.transpose()).eval();
        P.topLeftCorner(c, c) += Q;
        MatrixXd H_whole = MatrixXd::Zero(6, n);
        H_whole.leftCols(c) = H;
        P = (P.inverse() + H_whole.transpose() * H_whole).inverse().eval();
        mean += P * H_whole.transpose() * r;
    }
    state.settle();
    EXPECT_LT((MatrixXd(state.covariance()) - P).norm(), 1e-8 * P.norm());
    EXPECT_LT(
        (state.landmarks()[2].point.x - before - mean.segment<3>(state.landmark_offset(2))).norm(),
        1e-8 * mean.norm());
}

TEST(IekfLinear, AugmentationIsSmithSelfCheeseman) {
    std::mt19937 random(3);
    FilterState state = some_state(random, CoreKind::inertial, true);
    const MatrixXd P = state.covariance();
    const int w = state.window_size(), n = state.size();
    MatrixXd G = MatrixXd::Zero(6, n);
    G.leftCols(w) = random_matrix(random, 6, w);
    const MatrixXd noise = random_covariance(random, 6);
    state.augment(std::vector<LandmarkState>(2), G.leftCols(w), noise);
    MatrixXd expected(n + 6, n + 6);
    expected << P, P * G.transpose(), G * P, G * P * G.transpose() + noise;
    EXPECT_LT((state.covariance() - expected).norm(), 1e-12 * expected.norm());
    // Removing them again, and an older one, leaves the marginal.
    state.marginalise({false, true, false, false, true, true});
    const int at = state.landmark_offset(1);
    MatrixXd kept(n - 3, n - 3);
    kept << P.topLeftCorner(at, at), P.topRightCorner(at, n - at - 3),
        P.bottomLeftCorner(n - at - 3, at), P.bottomRightCorner(n - at - 3, n - at - 3);
    EXPECT_LT((state.covariance() - kept).norm(), 1e-12 * kept.norm());
}

// ---- Observability ------------------------------------------------------------------------------

/// Errors that a shift of the world and a turn of it about the axes make; the axes are that of
/// gravity, or all three where gravity is part of the state.
MatrixXd unobservable(const FilterState& state) {
    const bool turns_gravity = state.core_size() > kGravity;
    const int turns = turns_gravity ? 3 : 1;
    MatrixXd N = MatrixXd::Zero(state.size(), 3 + turns);
    for (int k = 0; k < 3; ++k) {
        const Vector3d e = Vector3d::Unit(k);
        N.block<3, 1>(kPosition, k) = e;
        for (int i = 0; i < static_cast<int>(state.clones().size()); ++i)
            N.block<3, 1>(state.clone_offset(i) + 3, k) = e;
    }
    for (int k = 0; k < turns; ++k) {
        const Vector3d e = turns_gravity ? Vector3d(Vector3d::Unit(k)) : Vector3d::UnitZ();
        const int column = 3 + k;
        const CoreState& core = state.core();
        N.block<3, 1>(kRotation, column) = core.T_W_I.R.transpose() * e;
        N.block<3, 1>(kPosition, column) = e.cross(core.T_W_I.p);
        N.block<3, 1>(kVelocity, column) = e.cross(core.v_W);
        if (turns_gravity) {
            N.block<3, 1>(kGravity, column) = e.cross(core.g_W);
            N.block<3, 1>(kAcceleration, column) = e.cross(core.a_W);
        }
        for (int i = 0; i < static_cast<int>(state.clones().size()); ++i) {
            const Pose& clone = state.clones()[i].T_W_I;
            N.block<3, 1>(state.clone_offset(i), column) = clone.R.transpose() * e;
            N.block<3, 1>(state.clone_offset(i) + 3, column) = e.cross(clone.p);
        }
    }
    return N;
}

/// Information about the directions N, N^T P^-1 N. The core's pose is left out: the newest clone
/// says the same.
MatrixXd information(const FilterState& state, const MatrixXd& N) {
    const int n = state.size() - 6;
    return N.bottomRows(n).transpose() *
           MatrixXd(state.covariance().bottomRightCorner(n, n)).ldlt().solve(N.bottomRows(n));
}

/// Largest gain of information about an unobservable direction at an image's updates, relative to
/// what there was, over a run with noisy measurements.
double largest_gain(const std::string& model, bool invariant) {
    const test::SimulatedRun run = test::simulate_run({.seconds = 4, .features = 40});
    const Pose T_I_C = run.rig.T_I_C();
    const auto motion = model == "smooth" ? make_smooth_motion(run.rig.imu_noise, {1e3, 1e3}, 0.02)
                                          : make_imu_driven_motion(run.rig.imu_noise);
    CoreState core;
    core.T_W_I = run.truth[0].T_W_B * run.rig.T_B_I;
    core.v_W = test::SimulatedPath::velocity(0.37 / 20);
    core.g_W = {0, 0, -9.81};
    core.gyro_bias = run.truth[0].gyro_bias;
    core.accel_bias = run.truth[0].accel_bias;
    Matrix15d P = 1e-4 * Matrix15d::Identity();
    CoreMatrix lift;
    FilterState state = motion->start(core, P, run.readings[4], invariant, &lift);
    const double mounted = 0.01 * 0.01;
    state.start_mount({T_I_C, 0},
                      model == "smooth"
                          ? MatrixXd()
                          : MatrixXd(mounted * Eigen::Matrix<double, 7, 7>::Identity()));
    Window window({.angular_sigma = 1 / 458.0}, run.rig.camera);

    ImuReading now = run.readings[4];
    now.t = run.frames[0].t;
    std::size_t next = 4;
    while (run.readings[next].t <= now.t) ++next;
    double largest = 0;
    for (int image = 1; image < static_cast<int>(run.frames.size()); ++image) {
        const FeatureFrame& frame = run.frames[image];
        for (; run.readings[next].t < frame.t; now = run.readings[next++]) {
            motion->advance(state, now, run.readings[next]);
            motion->measure(state, run.readings[next], 0.005);
        }
        ImuReading at = run.readings[next];
        at.t = frame.t;
        motion->advance(state, now, at);
        now = at;
        state.settle();
        state.clone(image, rate_of(state.core(), now).head<6>());
        const int slot = state.find_clone(image);

        std::vector<LandmarkSight> known;
        for (const FeatureObservation& feature : frame.features) {
            const Sight sight = *make_sight(feature, 1.0);
            int idx = -1;
            for (int i = 0; i < static_cast<int>(state.landmarks().size()); ++i)
                if (state.landmarks()[i].id == feature.feature_id) idx = i;
            if (idx >= 0)
                known.push_back({idx, sight});
            else
                window.observe(feature.feature_id, image, sight);
        }
        known = gated_sights(state, known, slot, *run.rig.camera, 13.8);
        const MatrixXd before = information(state, unobservable(state));
        if (!known.empty()) update_landmarks(state, known, slot, *run.rig.camera, 3);
        const int leaving = image > 10 ? image - 11 : -1;
        window.use(state, image, leaving);
        const MatrixXd gained = information(state, unobservable(state)) - before;
        largest = std::max(
            largest, (gained.diagonal().array() / before.diagonal().array()).abs().maxCoeff());
        if (leaving >= 0 && state.find_clone(leaving) >= 0) {
            window.forget_image(leaving);
            const int oldest = state.find_clone(leaving);
            for (int i = 0; i < static_cast<int>(state.landmarks().size()); ++i)
                if (state.landmarks()[i].anchor == oldest)
                    state.reanchor(
                        i, slot,
                        moved_anchor(state.landmarks()[i].point, state.clones()[oldest].T_W_I,
                                     state.clones()[slot].T_W_I, state.mount().T_I_C));
            state.release_clone(oldest);
        }
    }
    EXPECT_GT(state.landmarks().size(), 10u);
    return largest;
}

TEST(IekfObservability, UpdatesGainNothingAboutGaugeDirections) {
    EXPECT_LT(largest_gain("imu_driven", true), 1e-5);
    EXPECT_LT(largest_gain("smooth", true), 1e-4);
}

TEST(IekfObservability, NaiveFilterGainsSpuriousInformation) {
    EXPECT_GT(largest_gain("imu_driven", false), 1e-2);
}

// ---- Whole runs
// -----------------------------------------------------------------------------------

Estimate estimate_of(const test::SimulatedRun& run, const IekfOptions& options) {
    Iekf filter(run.rig, options, {});
    filter.start(test::sampled_start(run, 5, 77));
    std::size_t next = 5;
    for (const ImuReading& reading : run.readings) {
        while (next < run.frames.size() && run.frames[next].t <= reading.t)
            filter.add(run.frames[next++]);
        filter.add(reading);
    }
    filter.finish();
    return filter.estimate();
}

TEST(IekfRun, SameInputSameBytes) {
    const test::SimulatedRun run = test::simulate_run({.seconds = 5, .outliers = 0.05});
    const Estimate a = estimate_of(run, {}), b = estimate_of(run, {});
    ASSERT_EQ(a.states.size(), b.states.size());
    ASSERT_GT(a.states.size(), 80u);
    for (std::size_t i = 0; i < a.states.size(); ++i) {
        EXPECT_EQ(0, std::memcmp(&a.states[i].T_W_B, &b.states[i].T_W_B, sizeof(Pose)));
        EXPECT_EQ(0, std::memcmp(a.states[i].covariance.data(), b.states[i].covariance.data(),
                                 sizeof(Matrix15d)));
    }
}

TEST(IekfRun, CovarianceStaysPositiveDefinite) {
    const test::SimulatedRun run = test::simulate_run({.seconds = 60});
    const Estimate estimate = estimate_of(run, {});
    ASSERT_EQ(estimate.states.size(), run.frames.size() - 6);
    for (const StateEstimate& state : estimate.states) {
        ASSERT_EQ(state.covariance, state.covariance.transpose());
        ASSERT_EQ(state.covariance.llt().info(), Eigen::Success);
    }
}

TEST(IekfRun, WholeCovarianceWithManyLandmarksStaysACovariance) {
    const test::SimulatedRun run = test::simulate_run({.seconds = 6, .features = 120});
    IekfOptions options;
    options.max_landmarks = 120;
    Iekf filter(run.rig, options, {});
    filter.start(test::sampled_start(run, 5, 77));
    std::size_t next = 5;
    for (const ImuReading& reading : run.readings) {
        while (next < run.frames.size() && run.frames[next].t <= reading.t) {
            filter.add(run.frames[next]);
            const FilterState* state = filter.state();
            if (next++ % 10 != 9 || state == nullptr) continue;
            const MatrixXd P = state->covariance();
            ASSERT_EQ(P, MatrixXd(P.transpose()));
            const VectorXd sigma = P.diagonal().cwiseSqrt();
            const MatrixXd correlation =
                (P.array() / (sigma * sigma.transpose()).array()).matrix() +
                1e-12 * MatrixXd::Identity(P.rows(), P.cols());  // a clone may be where the core is
            ASSERT_EQ(correlation.llt().info(), Eigen::Success);
        }
        filter.add(reading);
    }
    EXPECT_GT(filter.state()->landmarks().size(), 60u);
}

}  // namespace
}  // namespace vio
