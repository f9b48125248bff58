#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "libvio/batch/marginals.h"
#include "libvio/batch/minimize.h"
#include "libvio/batch/start.h"
#include "tests/draws.h"
#include "tests/simulated_batch.h"
#include "tests/unit/dense_information.h"

namespace vio::batch {
namespace {

test::SimulatedRun short_run(double sigma_px = 1, bool noisy_imu = true) {
    test::SimulatedRunOptions options;
    options.seconds = 1;
    options.features = 30;
    options.longest_track = 8;
    options.sigma_px = sigma_px;
    if (!noisy_imu) options.noise = {1e-9, 1e-8, 1e-9, 1e-8, 0};
    return simulate_run(options);
}

// A matrix with low-rank terms, against dense algebra: solution, entries of the inverse, refusal of
// an indefinite one. Blocks 0-3 and 4-7 are halves, 8 and 9 between, 10 last.
TEST(BlockCholesky, SolvesAndInvertsAsADenseMatrixDoes) {
    const std::vector<int> dims{6, 9, 6, 9, 6, 9, 6, 3, 6, 3, 3};
    BlockMatrix A(dims, {{1, 0},  {2, 0},  {2, 1},  {3, 1},  {3, 2},  {8, 2},  {9, 0}, {9, 2},
                         {5, 4},  {6, 4},  {6, 5},  {7, 6},  {7, 4},  {8, 6},  {9, 8}, {10, 0},
                         {10, 1}, {10, 2}, {10, 3}, {10, 4}, {10, 5}, {10, 6}, {10, 8}});
    const std::vector<Part> parts{Part::first_half,  Part::first_half,  Part::first_half,
                                  Part::first_half,  Part::second_half, Part::second_half,
                                  Part::second_half, Part::second_half, Part::between,
                                  Part::between,     Part::last};
    BlockSets sets;
    sets.blocks = {0, 2, 8, 4, 6, 8, 6, 8};
    sets.first = {0, 2, 3, 3, 6, 8};
    sets.terms = {0, 3, 5, 5, 8};  // the third set is empty, one term is not used
    std::mt19937 engine(5);
    std::normal_distribution<double> normal;
    const auto random = [&](auto& matrix) {
        for (int k = 0; k < matrix.size(); ++k) matrix.data()[k] = normal(engine);
    };
    for (double& value : A.values()) value = normal(engine);
    for (int k = 0; k < A.size(); ++k) A.diagonal(k) += 60;
    Eigen::VectorXd d(A.size()), a(A.size());
    random(d), random(a);
    std::vector<Matrix63d> W(10);
    std::vector<Eigen::Matrix3d> Q(5);
    std::vector<Eigen::Vector3d> b(5);
    for (auto& w : W) random(w);
    for (auto& q : Q) {
        random(q);
        q = (0.3 * q.triangularView<Eigen::Upper>().toDenseMatrix()).eval();
    }
    for (auto& x : b) random(x);

    Eigen::MatrixXd S = test::dense(A, static_cast<int>(dims.size()));
    S += d.asDiagonal();
    Eigen::VectorXd s = a;
    for (int k = 0; k < sets.count(); ++k) {
        Eigen::MatrixXd T = Eigen::MatrixXd::Zero(A.size(), 3);
        for (int i = sets.first[k]; i < sets.first[k + 1]; ++i)
            T.middleRows<6>(A.offset(sets.blocks[i])) = W[sets.terms[k] + i - sets.first[k]] * Q[k];
        S -= T * T.transpose();
        s -= T * (Q[k].transpose() * b[k]);
    }
    const Eigen::MatrixXd inverse = S.inverse();
    for (int threads : {1, 2}) {
        BlockCholesky factor(A, sets, parts, threads);
        ASSERT_TRUE(factor.factorize({A, d, a, W, Q, b}));
        Eigen::VectorXd x;
        factor.solve(x);
        EXPECT_LT((x - inverse * s).norm(), 1e-12);
        const Eigen::MatrixXd B = Eigen::MatrixXd::Random(A.size(), 3);
        EXPECT_LT((factor.solve(B) - inverse * B).norm(), 1e-12);
        const auto sparse = factor.sparse_inverse();
        for (size_t col = 0; col < dims.size(); ++col)
            for (int row : A.rows(static_cast<int>(col))) {
                const int r = A.offset(row), c = A.offset(static_cast<int>(col)),
                          k = static_cast<int>(col);
                const Eigen::MatrixXd expected = inverse.block(r, c, dims[row], dims[col]);
                EXPECT_LT((sparse.block(row, k) - expected).norm(), 1e-12);
                EXPECT_LT((sparse.block(k, row) - expected.transpose()).norm(), 1e-12);
            }
        BlockMatrix indefinite = A;
        indefinite.diagonal(3) = -100;
        EXPECT_FALSE(factor.factorize({indefinite, d, a, W, Q, b}));
    }
}

struct Variant {
    std::string bias, weighting;
    bool gravity_free, inertial;
    int border;  // number of points kept in the border
};

class BatchVariants : public ::testing::TestWithParam<Variant> {
 protected:
    BatchVariants() : run_(short_run()), problem_(test::batch_problem(run_, GetParam().inertial)) {
        options_.bias = GetParam().bias;
        options_.weighting = GetParam().weighting;
        model_ = make_model(problem_, options_, static_cast<int>(problem_.frames.size()));
        layout_ = make_layout(model_, options_);
        layout_.border_points = GetParam().border;
        for (int j = 0; j < GetParam().border; ++j) layout_.border_of_point[j] = j;
        // Near the truth, but off it in every unknown.
        state_ = given_start(model_, test::truth_from(run_, {}));
        std::mt19937 engine(2);
        std::normal_distribution<double> normal;
        const auto noise = [&](double s) {
            return Eigen::Vector3d(s * test::normal_vector<3>(normal, engine));
        };
        for (auto& frame : state_.frames) {
            frame.motion.R = frame.motion.R * so3::exp(noise(0.01));
            frame.motion.p += noise(0.02);
            frame.motion.v += noise(0.05);
        }
        for (auto& frame : state_.frames) frame.bias = state_.frames.front().bias;
        for (auto& point : state_.points) point += noise(0.03);
        if (GetParam().gravity_free) state_.gravity += noise(0.1);
    }

    double cost_after(const Objective& objective, const Step& step) const {
        State next;
        objective.apply(state_, step, layout_, next);
        return objective.evaluate(next).total();
    }

    test::SimulatedRun run_;
    BatchProblem problem_;
    BatchOptions options_;
    Model model_;
    Layout layout_;
    State state_;
};

TEST_P(BatchVariants, GradientIsTheDerivativeOfTheCost) {
    Objective objective(model_, options_, {GetParam().gravity_free, "none"});
    NormalEquations equations(model_, layout_);
    objective.linearize(state_, equations);
    std::mt19937 engine(3);
    std::normal_distribution<double> normal;
    for (int trial = 0; trial < 10; ++trial) {
        Step step;
        step.reduced.resize(equations.matrix.size());
        for (double& x : step.reduced) x = 1e-5 * normal(engine);
        if (!model_.surveyed())
            for (int c = 0; c < 6; ++c) step.reduced(layout_.index(0, c)) = 0;
        for (size_t j = 0; j < model_.points.size(); ++j)
            step.points.push_back(1e-5 * test::normal_vector<3>(normal, engine));
        double analytic = 0;
        for (size_t j = 0; j < model_.points.size(); ++j) {
            analytic += 2 * step.points[j].dot(equations.b[j]);
            if (const int slot = layout_.border_of_point[j]; slot >= 0)
                step.reduced.segment<3>(equations.matrix.offset(layout_.border_block(slot)))
                    .setZero();
        }
        analytic += 2 * step.reduced.dot(equations.gradient);
        Step back = step;
        back.reduced *= -1;
        for (auto& point : back.points) point *= -1;
        const double numeric = (cost_after(objective, step) - cost_after(objective, back)) / 2;
        EXPECT_NEAR(numeric, analytic, 1e-5 * std::abs(analytic) + 1e-4);
    }
}

TEST_P(BatchVariants, PointEliminationSolvesTheWholeSystem) {
    // One damped step against the dense solution of poses and points together.
    Objective objective(model_, options_, {GetParam().gravity_free, "none"});
    NormalEquations equations(model_, layout_);
    objective.linearize(state_, equations);
    const int n = equations.matrix.size(), m = static_cast<int>(model_.points.size());
    const Eigen::MatrixXd H = test::dense_information(equations, model_);
    Eigen::VectorXd g(n + 3 * m);
    g.head(n) = equations.gradient;
    for (int j = 0; j < m; ++j) g.segment<3>(n + 3 * j) = equations.b[j];
    for (int slot = 0; slot < layout_.border_points; ++slot)
        g.segment<3>(equations.matrix.offset(layout_.border_block(slot))).setZero();
    const double lambda = 1e-3;
    using Damping = NormalEquations::PointDamping;
    for (const Damping damping : {Damping::alike, Damping::as_seen}) {
        Eigen::MatrixXd damped = H;
        for (int k = 0; k < n; ++k) damped(k, k) += lambda * std::max(1e-6, H(k, k));
        for (int j = 0; j < m; ++j) {
            auto V = damped.block<3, 3>(n + 3 * j, n + 3 * j);
            if (layout_.border_of_point[j] >= 0)  // as all unknowns of the reduced system
                V.diagonal() *= 1 + lambda;
            else if (damping == Damping::as_seen)
                V *= 1 + lambda;
            else
                V.diagonal().array() += lambda * V.trace() / 3;
        }
        const Eigen::VectorXd x = damped.ldlt().solve(-g);
        equations.point_damping = damping;
        Step step;
        ASSERT_TRUE(equations.solve(lambda, step));
        for (int i = 0; i < layout_.frames; ++i)
            for (int c = 0; c < 15; ++c) {
                const int k = layout_.index(i, c);
                if (k < 0) continue;
                EXPECT_NEAR(step.reduced(k), x(k), 1e-6 * (1 + std::abs(x(k))));
            }
        for (int j = 0; j < m; ++j)
            EXPECT_LT((step.points[j] - x.segment<3>(n + 3 * j)).norm(), 1e-6 * (1 + x.norm()));
        // Promised by the quadratic model of the undamped H.
        const double promised = -2 * g.dot(x) - x.dot(H * x);
        EXPECT_NEAR(equations.predicted_decrease(step), promised, 1e-4 * promised);
    }
}

// With the equations as they were it is the same step. After a step that promised less than a
// squared standard deviation it promises no less than the new equations do.
TEST_P(BatchVariants, LastFactorisationForetellsTheNextStep) {
    Objective objective(model_, options_, {GetParam().gravity_free, "none"});
    NormalEquations equations(model_, layout_);
    objective.linearize(state_, equations);
    Step step, foretold;
    int told = 0;
    double promised_before = std::numeric_limits<double>::infinity(), promise = 0;
    for (int k = 0; k < 8; ++k) {
        ASSERT_TRUE(equations.solve(1e-8, step));
        const double promised = equations.predicted_decrease(step);
        if (promised_before < 1) {
            EXPECT_GT(promise, 0.8 * promised - 1e-6);
            ++told;
        }
        promised_before = promised;
        ASSERT_TRUE(equations.resolve(foretold));
        EXPECT_LT((foretold.reduced - step.reduced).norm(), 1e-6 * step.reduced.norm());
        for (size_t j = 0; j < model_.points.size(); ++j)
            EXPECT_LT((foretold.points[j] - step.points[j]).norm(), 1e-6 * step.points[j].norm());
        State next;
        objective.apply(state_, step, layout_, next);
        objective.settle_points(state_, next);
        state_ = next;
        objective.linearize(state_, equations);
        ASSERT_TRUE(equations.resolve(foretold));
        promise = equations.predicted_decrease(foretold);
    }
    EXPECT_GT(told, 0);
}

// A far point goes where a camera that sees it goes, and no step takes it behind that camera or
// beyond infinity: steps along the sight line change the inverse range.
TEST_P(BatchVariants, PointsMoveAlongInverseRange) {
    const Objective objective(model_, options_, {GetParam().gravity_free, "none"});
    const Point& point = model_.points[3];
    const int i = model_.observations[point.first_observation].frame_idx;
    const auto in_camera = [&](const State& state) {
        const InertialState& I = state.frames[i].motion;
        return (Pose{I.R, I.p} * model_.T_I_C).inverse() * state.points[3];
    };
    const Pose T_W_C = Pose{state_.frames[i].motion.R, state_.frames[i].motion.p} * model_.T_I_C;
    const Eigen::Vector3d line = in_camera(state_);
    Step step;
    step.reduced.setZero(NormalEquations(model_, layout_).matrix.size());
    step.points.assign(model_.points.size(), Eigen::Vector3d::Zero());
    const auto moved_by = [&](const Eigen::Vector3d& d_C) {
        step.points[3] = T_W_C.R * d_C;
        State next;
        objective.apply(state_, step, layout_, next);
        return in_camera(next);
    };
    const double range = line.norm();
    for (const double share : {-3.0, -0.5, 0.3, 0.8}) {
        const Eigen::Vector3d moved = moved_by(share * line);
        EXPECT_NEAR(1 / moved.norm(), (1 - share) / range, 1e-9 / range);
        EXPECT_LT((moved.normalized() - line.normalized()).norm(), 1e-9);
    }
    EXPECT_GT(moved_by(5 * line).dot(line), range * range);  // not through infinity
    const Eigen::Vector3d across = line.unitOrthogonal() * range;
    EXPECT_LT((moved_by(across) - line - across).norm(), 1e-9 * range);
}

TEST_P(BatchVariants, PointsOutOfSightAreDrawnBack) {
    // A point behind the camera: its gradient is the derivative of its cost, and points home.
    Objective objective(model_, options_, {GetParam().gravity_free, "none"});
    const Observation& observation = model_.observations[40];
    const int j = observation.point_idx;
    const Eigen::Vector3d truth = state_.points[j];
    const Pose T_W_C = Pose{state_.frames[observation.frame_idx].motion.R,
                            state_.frames[observation.frame_idx].motion.p} *
                       model_.T_I_C;
    state_.points[j] = T_W_C * Eigen::Vector3d(0.7, 0.3, -1);
    ASSERT_FALSE(objective.image_residual(state_, observation));
    NormalEquations equations(model_, layout_);
    objective.linearize(state_, equations);
    EXPECT_LT(equations.b[j].dot(truth - state_.points[j]), 0);
    for (int c = 0; c < 3; ++c) {
        const auto cost = [&](double step) {
            State moved = state_;
            moved.points[j](c) += step;
            return objective.evaluate(moved).total();
        };
        const double numeric = (cost(1e-6) - cost(-1e-6)) / 2e-6;
        EXPECT_NEAR(numeric, 2 * equations.b[j](c), 1e-4 * equations.b[j].norm());
    }
}

INSTANTIATE_TEST_SUITE_P(All, BatchVariants,
                         ::testing::Values(Variant{"random_walk", "preintegrated", false, true, 0},
                                           Variant{"random_walk", "preintegrated", true, true, 5},
                                           Variant{"constant", "preintegrated", false, true, 3},
                                           Variant{"constant", "fixed", true, true, 0},
                                           Variant{"random_walk", "preintegrated", false, false,
                                                   2}),
                         [](const auto& param) { return "variant" + std::to_string(param.index); });

TEST(Batch, BlindStartFindsTheTruthWithoutNoise) {
    test::SimulatedRunOptions options;
    options.seconds = 2;
    options.sigma_px = 1e-3;
    options.imu_hz = 1000;  // leaves the integration's own error behind
    options.noise = {1e-6, 1e-5, 1e-7, 1e-6, 0};
    const auto run = simulate_run(options);
    BatchOptions batch;
    batch.start = "blind";
    batch.sigma_px = 0.01;
    const BatchResult result = estimate_batch(test::batch_problem(run), batch);
    ASSERT_TRUE(result.report.converged) << result.report.reason;
    const Estimate truth = test::truth_from(run, result.estimate.states.front().T_W_B);
    for (size_t i = 0; i < truth.states.size(); ++i) {
        const auto e = test::state_error(result.estimate.states[i], truth.states[i]);
        EXPECT_LT(e.segment<3>(kRotation).norm(), 1e-4);
        EXPECT_LT(e.segment<3>(kPosition).norm(), 1e-3);
        EXPECT_LT(e.segment<3>(kVelocity).norm(), 1e-3);
    }
}

TEST(Batch, FixedWeightsAndConstantBiasConvergeToo) {
    const auto run = short_run(0.5);
    BatchOptions options;
    options.weighting = "fixed";
    options.bias = "constant";
    options.gravity = "free";
    options.start = "blind";
    const BatchResult result = estimate_batch(test::batch_problem(run), options);
    ASSERT_TRUE(result.report.converged) << result.report.reason;
    EXPECT_NEAR(result.estimate.g_W.norm(), 9.81, 0.3);
}

TEST(Batch, DropsGrossMistracks) {
    test::SimulatedRunOptions simulation;
    simulation.seconds = 2;
    simulation.outliers = 0.05;
    const auto run = simulate_run(simulation);
    const BatchResult result = estimate_batch(test::batch_problem(run), {});
    ASSERT_TRUE(result.report.converged) << result.report.reason;
    const Estimate truth = test::truth_from(run, result.estimate.states.front().T_W_B);
    const auto e = test::state_error(result.estimate.states.back(), truth.states.back());
    const Eigen::Vector3d p = e.segment<3>(kPosition);
    const Eigen::Matrix3d C =
        result.estimate.states.back().covariance.block<3, 3>(kPosition, kPosition);
    EXPECT_GT(result.report.outliers, 0.03 * result.report.observations);
    EXPECT_LT(p.dot(C.inverse() * p), 16.3);  // chi-square(3) at 99.9 %
}

TEST(Batch, TailIsTheMarginalOfTheWholeEstimate) {
    const auto run = short_run();
    const BatchResult result = estimate_batch(test::batch_problem(run), {}, std::nullopt, true);
    ASSERT_TRUE(result.tail);
    const BatchTail& tail = *result.tail;
    ASSERT_EQ(tail.covariance.rows(), 15 + 3 * static_cast<int>(tail.landmarks.size()));
    EXPECT_GT(tail.landmarks.size(), 10u);
    const StateEstimate& last = result.estimate.states.back();
    EXPECT_LT((tail.state.covariance - last.covariance).norm(), 1e-6 * last.covariance.norm());
    EXPECT_LT(tail.state.T_W_B.boxminus(last.T_W_B).norm(), 1e-12);
    for (const LandmarkEstimate& landmark : tail.landmarks)
        for (const LandmarkEstimate& other : result.estimate.landmarks)
            if (other.id == landmark.id) {
                EXPECT_LT((landmark.covariance - other.covariance).norm(),
                          1e-6 * other.covariance.norm());
                EXPECT_LT((landmark.p_W - other.p_W).norm(), 1e-12);
            }
    EXPECT_EQ(
        Eigen::LLT<Eigen::MatrixXd>(tail.covariance.bottomRightCorner(tail.covariance.rows() - 15,
                                                                      tail.covariance.rows() - 15))
            .info(),
        Eigen::Success);
}

TEST(Batch, FiducialsPutTheEstimateIntoTheSurveysFrame) {
    const auto run = short_run();
    BatchProblem problem = test::batch_problem(run);
    for (size_t id = 0; id < run.point_of_feature.size(); ++id)
        problem.fiducials[static_cast<FeatureId>(id)] = {run.points[run.point_of_feature[id]],
                                                         Eigen::Matrix3d::Identity() * 1e-6};
    const BatchResult result = estimate_batch(problem, {});
    ASSERT_TRUE(result.report.converged) << result.report.reason;
    for (size_t i = 0; i < run.truth.size(); ++i) {
        const auto e = test::state_error(result.estimate.states[i], run.truth[i]);
        const Vector6d pose = e.head<6>();
        const Matrix6d C = result.estimate.states[i].covariance.topLeftCorner<6, 6>();
        EXPECT_LT(pose.dot(C.inverse() * pose), 27.9);  // chi-square(6) at 99.99 %
    }
}

TEST(Batch, ResultsDoNotDependOnTheNumberOfThreads) {
    test::SimulatedRunOptions simulation;
    simulation.seconds = 4;
    simulation.longest_track = 15;  // so that the problem comes apart into halves
    const auto run = simulate_run(simulation);
    BatchOptions options;
    options.threads = 1;
    const BatchResult one = estimate_batch(test::batch_problem(run), options);
    options.threads = 2;
    const BatchResult two = estimate_batch(test::batch_problem(run), options);
    EXPECT_EQ(one.report.final_cost, two.report.final_cost);
    ASSERT_EQ(one.estimate.states.size(), two.estimate.states.size());
    for (size_t i = 0; i < one.estimate.states.size(); ++i) {
        EXPECT_EQ(one.estimate.states[i].T_W_B.p, two.estimate.states[i].T_W_B.p);
        EXPECT_EQ(one.estimate.states[i].covariance, two.estimate.states[i].covariance);
    }
}

// A path for which something cannot be known: the report says what, instead of a converged result.
BatchReport report_of(const test::SimulatedRun& run, const Estimate& start) {
    BatchOptions options;
    options.loss = "none";
    options.outlier_sigmas = 0;
    return estimate_batch(test::batch_problem(run), options, start).report;
}

TEST(Batch, SaysWhatACameraAtRestLeavesOpen) {
    test::SimulatedRunOptions simulation;
    simulation.seconds = 3;
    simulation.position = [](double) { return Eigen::Vector3d(0.1, 0.2, 0.3); };
    simulation.rotation = [](double) -> Eigen::Matrix3d { return so3::exp({0.1, 0.2, 0.3}); };
    const auto run = simulate_run(simulation);
    const BatchReport report = report_of(run, test::truth_of(run));
    EXPECT_FALSE(report.converged);
    EXPECT_FALSE(report.undetermined.empty());
    EXPECT_NE(report.reason.find("not determined"), std::string::npos) << report.reason;
}

TEST(Batch, SaysThatSteadyStraightMotionLeavesTheScaleOpen) {
    test::SimulatedRunOptions simulation;
    simulation.seconds = 3;
    simulation.position = [](double t) { return Eigen::Vector3d(0.3 * t, 0.1, 0.1 * t); };
    simulation.rotation = [](double) -> Eigen::Matrix3d { return so3::exp({0.1, 0.2, 0.3}); };
    const auto run = simulate_run(simulation);
    const BatchReport report = report_of(run, test::truth_of(run));
    EXPECT_FALSE(report.converged);
    EXPECT_GT(report.scale_sigma, 0.5);
    EXPECT_NE(report.reason.find("scale"), std::string::npos) << report.reason;
    // Lively motion of the same length determines it.
    const auto lively = short_run();
    EXPECT_LT(report_of(lively, test::truth_of(lively)).scale_sigma, 0.2);
}

TEST(Batch, NamesTheImagesThatAreJoinedToNothing) {
    const auto run = short_run();
    BatchProblem problem = test::batch_problem(run, false);
    for (size_t i = 12; i < problem.frames.size(); ++i)
        for (auto& feature : problem.frames[i].features) feature.feature_id += 100000;
    BatchOptions options;
    options.loss = "none";
    options.outlier_sigmas = 0;
    const BatchReport report = estimate_batch(problem, options, test::truth_of(run)).report;
    EXPECT_FALSE(report.converged);
    EXPECT_NE(report.reason.find("the motion from 0.60 s "), std::string::npos) << report.reason;
}

TEST(Batch, LeavesImagesThatShowNothingOutOfAnImageOnlyEstimate) {
    const auto run = short_run();
    BatchProblem problem = test::batch_problem(run, false);
    for (size_t i = 8; i < 11; ++i) problem.frames[i].features.resize(i - 8);
    const BatchResult result = estimate_batch(problem, {}, test::truth_of(run));
    ASSERT_TRUE(result.report.converged) << result.report.reason;
    EXPECT_EQ(result.estimate.states.size(), problem.frames.size() - 3);
    for (const StateEstimate& state : result.estimate.states) EXPECT_GE(state.features, 4);
}

TEST(Batch, StartsFromATrajectoryThatLacksStates) {
    const auto run = short_run();
    Estimate part = test::truth_of(run);
    part.states.erase(part.states.begin() + 10, part.states.begin() + 14);
    part.states.erase(part.states.begin(), part.states.begin() + 3);
    part.landmarks.clear();
    const BatchResult result = estimate_batch(test::batch_problem(run), {}, part);
    const BatchResult whole = estimate_batch(test::batch_problem(run), {}, test::truth_of(run));
    ASSERT_TRUE(result.report.converged) << result.report.reason;
    // A minimisation may leave 1e-5 of the cost (MinimizeLimits::negligible).
    EXPECT_NEAR(result.report.final_cost, whole.report.final_cost, 1e-5 * whole.report.final_cost);
    part.states.resize(0);
    EXPECT_THROW(estimate_batch(test::batch_problem(run), {}, part), InputError);
}

// Readings that are missing weaken the interval that they are missing in, by what motion may have
// done there; others stay as they are.
TEST(Batch, TrustsReadingsAcrossAGapLess) {
    auto run = short_run();
    BatchProblem problem = test::batch_problem(run);
    const int frames = static_cast<int>(problem.frames.size());
    const Model whole = make_model(problem, {}, frames);
    std::vector<ImuReading> readings = run.readings;
    readings.erase(readings.begin() + 80, readings.begin() + 88);  // 40 ms of 50
    problem.imu = ImuSequence(readings);
    const Model gap = make_model(problem, {}, frames);
    int weaker = 0;
    for (size_t i = 0; i < gap.segments.size(); ++i) {
        const PreintegratedImu before(whole.segments[i], {}, whole.interval_noise[i]),
            after(gap.segments[i], {}, gap.interval_noise[i]);
        const Vector9d difference =
            after.residual(before.delta(), before.delta(), {}, Eigen::Vector3d::Zero()) -
            before.residual(before.delta(), before.delta(), {}, Eigen::Vector3d::Zero());
        if (difference.norm() < 1e-12) continue;
        ++weaker;
        // What the gap does to the integral is within what is now granted, and would not have been.
        EXPECT_LT(difference.dot(after.covariance().inverse() * difference), 27.9);
        EXPECT_GT(after.covariance().trace(), 4 * before.covariance().trace());
    }
    EXPECT_GE(weaker, 1);
    EXPECT_LE(weaker, 2);
}

// Images without a reading between them: a hole in the readings, an IMU slower than the camera, two
// images a millisecond apart.
class BatchWithFewReadings : public testing::TestWithParam<const char*> {};

TEST_P(BatchWithFewReadings, ConvergesAndHasCovariances) {
    const std::string what = GetParam();
    test::SimulatedRunOptions simulation;
    simulation.seconds = 4;
    if (what == "slow IMU") simulation.imu_hz = 15;
    auto run = simulate_run(simulation);
    if (what == "hole") run.readings.erase(run.readings.begin() + 300, run.readings.begin() + 324);
    if (what == "image twice") {
        FeatureFrame again = run.frames[40];
        again.t += 1'000'000;
        run.frames.insert(run.frames.begin() + 41, again);
        run.truth.insert(run.truth.begin() + 41, run.truth[40]);
    }
    BatchOptions options;
    options.start = "blind";
    const BatchResult result = estimate_batch(test::batch_problem(run), options);
    ASSERT_TRUE(result.report.converged) << result.report.reason;
    ASSERT_EQ(result.estimate.states.size(), run.frames.size());
    const Estimate truth = test::truth_from(run, result.estimate.states.front().T_W_B);
    for (size_t i = 0; i < truth.states.size(); ++i) {
        const StateEstimate& state = result.estimate.states[i];
        const auto e = test::state_error(state, truth.states[i]);
        EXPECT_LT(e.segment<3>(kRotation).norm(), 0.03) << i;
        EXPECT_LT(e.segment<3>(kPosition).norm(), 0.05) << i;
        EXPECT_TRUE(state.covariance.allFinite());
        if (i > 0) {
            EXPECT_GT(state.covariance.diagonal().minCoeff(), 0) << i;
        }
    }
}

INSTANTIATE_TEST_SUITE_P(Of, BatchWithFewReadings,
                         testing::Values("hole", "slow IMU", "image twice"));

TEST(Batch, RefusesWhatCannotBeEstimated) {
    const auto run = short_run();
    BatchProblem problem = test::batch_problem(run);
    problem.frames.resize(1);
    EXPECT_THROW(estimate_batch(problem, {}), InputError);
    problem = test::batch_problem(run);
    problem.rig.camera = nullptr;
    EXPECT_THROW(estimate_batch(problem, {}), InputError);
    problem = test::batch_problem(run);
    problem.imu = ImuSequence({run.readings[50], run.readings[51]});
    EXPECT_THROW(estimate_batch(problem, {}), InputError);
    problem = test::batch_problem(run);
    for (FeatureFrame& frame : problem.frames) frame.features.clear();
    EXPECT_THROW(estimate_batch(problem, {}), InputError);
}

}  // namespace
}  // namespace vio::batch
