// What the batch estimator publishes: covariances, robust losses, directional image noise,
// failures.
#include <gtest/gtest.h>

#include <random>

#include "libvio/batch/marginals.h"
#include "libvio/batch/minimize.h"
#include "libvio/batch/published_frame.h"
#include "libvio/batch/rig_refinement.h"
#include "libvio/batch/scale_noise.h"
#include "libvio/batch/start.h"
#include "libvio/io/mrpt_conversions.h"
#include "tests/simulated_batch.h"
#include "tests/unit/dense_information.h"

namespace vio::batch {
namespace {

test::SimulatedRunOptions short_run_options(unsigned seed = 1) {
    test::SimulatedRunOptions options;
    options.seed = seed;
    options.seconds = 1;
    options.features = 30;
    options.longest_track = 8;
    return options;
}

// A third of the points is surveyed, so that the published frame is the solver's.
BatchProblem surveyed_problem(const test::SimulatedRun& run) {
    BatchProblem problem = test::batch_problem(run);
    for (size_t id = 0; id < run.point_of_feature.size(); id += 3)
        problem.fiducials[static_cast<FeatureId>(id)] = {run.points[run.point_of_feature[id]],
                                                         Eigen::Matrix3d::Identity() * 1e-4};
    return problem;
}

TEST(BatchResults, MarginalsAndJointBlocksAreThoseOfTheDenseInverse) {
    const auto run = test::simulate_run(short_run_options());
    const BatchProblem problem = surveyed_problem(run);
    const BatchOptions options;
    const Model model = make_model(problem, options, static_cast<int>(problem.frames.size()));
    ASSERT_TRUE(model.surveyed());
    State state = given_start(model, test::truth_of(run));
    NormalEquations equations(model, make_layout(model, options));
    Objective objective(model, options, {});
    minimize(objective, equations, {}, state);
    objective.linearize(state, equations);
    const Eigen::MatrixXd dense = test::dense_covariance(equations, model);
    const int n = equations.matrix.size();
    ASSERT_TRUE(equations.factorize());
    const Estimate estimate = publish(model, objective, state, {}, &equations);
    const auto close = [](const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
        EXPECT_LT((a - b).norm(), 1e-6 * b.norm());
    };
    const Layout& layout = equations.layout();
    for (int i = 0; i < model.frames(); ++i) {
        const int gyro = layout.index(i, kGyroBias), rotation = layout.index(i, kRotation);
        const auto& C = estimate.states[i].covariance;
        const Eigen::Matrix3d R_B_I = model.T_I_B.R.transpose();
        close(C.block<3, 3>(kGyroBias, kGyroBias), dense.block<3, 3>(gyro, gyro));
        close(C.block<3, 3>(kRotation, kRotation),
              R_B_I * dense.block<3, 3>(rotation, rotation) * R_B_I.transpose());
        close(C.block<3, 3>(kGyroBias, kRotation),
              dense.block<3, 3>(gyro, rotation) * R_B_I.transpose());
    }
    std::map<FeatureId, int> column;
    for (size_t j = 0; j < model.points.size(); ++j)
        column[model.points[j].id] = n + 3 * static_cast<int>(j);
    for (const LandmarkEstimate& landmark : estimate.landmarks) {
        const int k = column.at(landmark.id);
        close(landmark.covariance, dense.block<3, 3>(k, k));
    }
    // The joint of the last state and its points.
    const BatchTail tail = publish_tail(model, objective, state, equations);
    ASSERT_GT(tail.landmarks.size(), 5u);
    std::vector<int> at{layout.index(model.frames() - 1, kGyroBias)};
    for (const LandmarkEstimate& landmark : tail.landmarks) at.push_back(column.at(landmark.id));
    for (size_t a = 0; a < at.size(); ++a)
        for (size_t b = 0; b <= a; ++b) {
            const auto place = [](size_t k) { return k == 0 ? 9 : 12 + 3 * static_cast<int>(k); };
            const double scale = std::sqrt(dense.block<3, 3>(at[a], at[a]).norm() *
                                           dense.block<3, 3>(at[b], at[b]).norm());
            EXPECT_LT(
                (tail.covariance.block<3, 3>(place(a), place(b)) - dense.block<3, 3>(at[a], at[b]))
                    .norm(),
                1e-6 * scale);
        }
}

struct Published {
    bool surveyed, inertial, rig_open, widened;
};

class PublishedCovariances : public ::testing::TestWithParam<Published> {
 protected:
    // A hundredth of the usual noise, so that terms of second order, judged elsewhere, are next to
    // nothing.
    static test::SimulatedRunOptions exact_run_options() {
        test::SimulatedRunOptions options = short_run_options();
        options.sigma_px = 0.01;
        options.noise = {1.7e-6, 2e-5, 2e-7, 3e-5, 0};
        return options;
    }

    PublishedCovariances() : run_(test::simulate_run(exact_run_options())) {
        problem_ = GetParam().surveyed ? surveyed_problem(run_) : test::batch_problem(run_);
        if (!GetParam().inertial) problem_.imu = {};
        options_.loss = "none";
        options_.sigma_px = 0.01;
        options_.gyro_bias_sigma = options_.accel_bias_sigma = 0.001;
        if (GetParam().rig_open) {
            options_.intrinsics_sigma = 0.03;
            options_.extrinsics_rotation_sigma = 0.01;
            options_.extrinsics_position_sigma = 2e-4;
            options_.time_offset_sigma = 4e-5;
        }
        model_ = make_model(problem_, options_, static_cast<int>(problem_.frames.size()));
        state_ = given_start(model_, test::truth_of(run_));
        objective_.emplace(model_, options_, Stage{});
        equations_.emplace(model_, make_layout(model_, options_));
        objective_->linearize(state_, *equations_);
        if (!GetParam().rig_open) return;
        const RigRefinement rig(problem_, model_, rig_unknowns(problem_.rig, options_),
                                rig_sigmas(problem_.rig, options_));
        rig.linearize(*objective_, state_, *equations_);
    }

    Estimate published(const State& state, const NormalEquations* equations = nullptr) const {
        return publish(model_, *objective_, state, {0, 3, 9, model_.frames() - 1}, equations);
    }

    // Of all that an estimate says, seen from another one: 15 for each state, 6 for each motion
    // between key-frames, 3 for each landmark and gravity.
    Eigen::VectorXd difference(const Estimate& other, const Estimate& b) const {
        // Where nothing tells heading and position, the frames of two estimates differ in them.
        const Estimate a =
            model_.surveyed() ? other : test::seen_from(other, b.states.front().T_W_B);
        std::vector<double> all;
        const auto add = [&](const auto& v) { all.insert(all.end(), v.begin(), v.end()); };
        for (size_t i = 0; i < a.states.size(); ++i)
            add(test::state_error(a.states[i], b.states[i]));
        for (size_t k = 0; k < a.keyframe_motions.size(); ++k)
            add(a.keyframe_motions[k].T_A_B.boxminus(b.keyframe_motions[k].T_A_B));
        for (size_t j = 0; j < a.landmarks.size(); ++j)
            add(Eigen::Vector3d(a.landmarks[j].p_W - b.landmarks[j].p_W));
        add(Eigen::Vector3d(a.g_W - b.g_W));
        return Eigen::Map<Eigen::VectorXd>(all.data(), static_cast<Eigen::Index>(all.size()));
    }

    // Of what is published wrt the reduced unknowns and the points, by central differences; zero
    // for those that are held.
    Eigen::MatrixXd jacobian(const Estimate& estimate) const {
        constexpr double kStep = 1e-5;
        const Layout& layout = equations_->layout();
        const int n = equations_->matrix.size(), m = static_cast<int>(model_.points.size());
        Eigen::MatrixXd J = Eigen::MatrixXd::Zero(difference(estimate, estimate).size(), n + 3 * m);
        Step step{Eigen::VectorXd::Zero(n), {}, {}};
        step.points.assign(m, Eigen::Vector3d::Zero());
        for (int k = 0; k < J.cols(); ++k) {
            if (!model_.surveyed() && k < 6) continue;                         // the first pose
            if (model_.inertial && k == layout.gravity_index() + 2) continue;  // gravity's norm
            double& x = k < n ? step.reduced(k) : step.points[(k - n) / 3]((k - n) % 3);
            State ahead, behind;
            x = kStep;
            objective_->apply(state_, step, layout, ahead);
            x = -kStep;
            objective_->apply(state_, step, layout, behind);
            x = 0;
            J.col(k) =
                (difference(published(ahead), estimate) - difference(published(behind), estimate)) /
                (2 * kStep);
        }
        return J;
    }

    test::SimulatedRun run_;
    BatchProblem problem_;
    BatchOptions options_;
    Model model_;
    State state_;
    std::optional<Objective> objective_;
    std::optional<NormalEquations> equations_;
};

// What is said of states, motions between key-frames (next to each other, and so far apart that no
// point joins them), landmarks and gravity: the covariance of all unknowns, mapped by the numerical
// derivative of what is published wrt them.
TEST_P(PublishedCovariances, AreTheDenseInverseMapped) {
    Eigen::MatrixXd dense = test::dense_covariance(*equations_, model_);
    ASSERT_TRUE(equations_->factorize());
    if (GetParam().widened) {
        constexpr double kFactor = 5;
        const Eigen::VectorXd c = scale_reading(model_, state_, *equations_);
        test::widen(dense, c, kFactor);
        equations_->widen(c, kFactor);
        EXPECT_NEAR(equations_->covariance(c)(0, 0),
                    c.dot(dense.topRows(c.size()).leftCols(c.size()) * c),
                    1e-6 * equations_->covariance(c)(0, 0));
        if (const auto& rig = equations_->rig_solution()) {
            const auto r = rig->covariance.rows();
            const Eigen::MatrixXd own = dense.bottomRightCorner(r, r);
            const Eigen::VectorXd scale = own.diagonal().cwiseSqrt().cwiseInverse();
            EXPECT_LT((scale.asDiagonal() *
                       (equations_->shared_errors()->covariance.topLeftCorner(r, r) - own) *
                       scale.asDiagonal())
                          .norm(),
                      1e-4);
        }
    }
    const Estimate estimate = published(state_, &*equations_);
    const Eigen::MatrixXd J = jacobian(estimate);
    const Eigen::MatrixXd mapped = J * dense.topLeftCorner(J.cols(), J.cols()) * J.transpose();
    int at = 0;
    const auto expect = [&](const char* what, const Eigen::MatrixXd& published) {
        const auto size = published.rows();
        const Eigen::MatrixXd expected = mapped.block(at, at, size, size);
        // In unknowns of unit variance, as their units differ.
        Eigen::VectorXd scale = expected.diagonal().cwiseMax(1e-20).cwiseSqrt().cwiseInverse();
        EXPECT_LT((scale.asDiagonal() * (published - expected) * scale.asDiagonal())
                      .cwiseAbs()
                      .maxCoeff(),
                  1e-4)
            << what << ' ' << at;
        at += static_cast<int>(size);
    };
    for (const StateEstimate& state : estimate.states) expect("state", state.covariance);
    ASSERT_EQ(estimate.keyframe_motions.size(), 3u);
    for (const RelativeMotion& motion : estimate.keyframe_motions)
        expect("motion", motion.covariance);
    ASSERT_GT(estimate.landmarks.size(), 30u);
    for (const LandmarkEstimate& landmark : estimate.landmarks)
        expect("landmark", landmark.covariance);
    if (GetParam().surveyed)
        expect("gravity", estimate.gravity_covariance);
    else  // z is against gravity, whose direction errs as the poses' tilt
        EXPECT_EQ(estimate.gravity_covariance.topRows<2>(), (Eigen::Matrix<double, 2, 3>::Zero()));
}

INSTANTIATE_TEST_SUITE_P(
    BatchResults, PublishedCovariances,
    ::testing::Values(Published{false, true, false, false}, Published{false, true, true, false},
                      Published{true, true, true, false}, Published{false, false, false, false},
                      Published{false, true, false, true}, Published{false, true, true, true}),
    [](const auto& variant) {
        const Published& p = variant.param;
        return std::string(p.surveyed ? "surveyed" : "free") + (p.inertial ? "" : "_image_only") +
               (p.rig_open ? "_rig_open" : "") + (p.widened ? "_widened" : "");
    });

// Against samples of two vectors that turn by a tilt of a degree while they err along themselves by
// a tenth: what is left once the first order is taken off.
TEST(BatchResults, TurningIsTheSecondMomentBeyondFirstOrder) {
    Gauge gauge;
    gauge.tilt_by_gravity = so3::skew(Eigen::Vector3d::UnitZ()) / 9.81;
    Vector6d v;
    v << 2, -1, 0.5, 0.3, 0.4, -0.1;
    // x: errors of the vectors, and of gravity, which does not change its length.
    Matrix9d root = Matrix9d::Zero();
    root.col(0) << 0.1 * v, 0, 0, 0;
    root.col(1) << 0.001 * v.reverse(), 0, 0, 0;
    root.col(2) << -0.05 * v, 0.1, 0.2, 0;
    root.col(3) << 0.02 * v.reverse(), 0.1, -0.15, 0;
    Eigen::Matrix<double, 6, 9> J;
    J << Matrix6d::Identity(), Eigen::Matrix<double, 6, 3>::Zero();
    for (const int k : {0, 3})
        J.block<3, 3>(k, 6) = -so3::skew(Eigen::Vector3d(v.segment<3>(k))) * gauge.tilt_by_gravity;
    const Matrix6d moment =
        Turning<6>(gauge, v, J, Matrix9d(root * root.transpose()), 6).second_moment();

    constexpr int kSamples = 100000;
    std::mt19937 engine(1);
    std::normal_distribution<double> normal;
    Matrix6d sampled = Matrix6d::Zero();
    for (int k = 0; k < kSamples; ++k) {
        Vector9d z;
        for (double& value : z) value = normal(engine);
        const Vector9d x = root * z;
        const Eigen::Matrix3d R = so3::exp(gauge.tilt_by_gravity * x.tail<3>());
        Vector6d left = -(v + J * x);
        for (const int i : {0, 3}) left.segment<3>(i) += R * (v + x.head<6>()).segment<3>(i);
        sampled += left * left.transpose() / kSamples;
    }
    // Fourth powers of what is sampled scatter by about five times their mean.
    const double scatter = 5 / std::sqrt(static_cast<double>(kSamples));
    EXPECT_LT((moment - sampled).norm(), 3 * scatter * moment.norm());
}

// As MRPT's pose with covariance in (x, y, z, yaw, pitch, roll): that of the marginal, mapped by
// the numerical derivative of MRPT's own coordinates.
TEST(BatchResults, PosePdfIsTheMarginal) {
    const auto run = test::simulate_run(short_run_options());
    const BatchResult result = estimate_batch(test::batch_problem(run), {});
    ASSERT_TRUE(result.report.converged) << result.report.reason;
    for (size_t i = 1; i < result.estimate.states.size(); i += 4) {
        const StateEstimate& state = result.estimate.states[i];
        const Matrix6d C = state.covariance.topLeftCorner<6, 6>();
        const auto pdf = to_mrpt(state.T_W_B, C);
        const auto coordinates = [&](const Vector6d& error) {
            const auto moved = to_mrpt(state.T_W_B.boxplus(error), C).mean;
            Vector6d v;
            v << moved.x(), moved.y(), moved.z(), moved.yaw(), moved.pitch(), moved.roll();
            return v;
        };
        Matrix6d J;
        for (int k = 0; k < 6; ++k)
            J.col(k) =
                (coordinates(1e-6 * Vector6d::Unit(k)) - coordinates(-1e-6 * Vector6d::Unit(k))) /
                2e-6;
        const Matrix6d expected = J * C * J.transpose();
        EXPECT_LT((pdf.cov.asEigen() - expected).norm(), 1e-6 * expected.norm());
    }
}

class BatchLoss : public ::testing::TestWithParam<std::string> {};

// Where outliers are left in, a robust loss keeps them from deciding.
TEST_P(BatchLoss, WithstandsOutliersThatAreLeftIn) {
    double robust = 0, square = 0;
    for (unsigned seed = 1; seed <= 3; ++seed) {
        auto simulation = short_run_options(seed);
        simulation.outliers = 0.01;
        const auto run = test::simulate_run(simulation);
        const auto error = [&](const std::string& loss) {
            BatchOptions options;
            options.loss = loss;
            options.outlier_sigmas = 0;
            options.covariances = false;
            const BatchResult result =
                estimate_batch(test::batch_problem(run), options, test::truth_of(run));
            EXPECT_FALSE(result.estimate.states.empty()) << result.report.reason;
            const Estimate truth = test::truth_from(run, result.estimate.states.front().T_W_B);
            return test::state_error(result.estimate.states.back(), truth.states.back())
                .segment<3>(kPosition)
                .norm();
        };
        robust += error(GetParam());
        square += error("none");
    }
    EXPECT_LT(robust, 0.5 * square);
}

// The IRLS gradient is that of the robust cost itself.
TEST_P(BatchLoss, GradientIsTheDerivativeOfTheCost) {
    auto simulation = short_run_options();
    simulation.sigma_px = 3;  // so that many residuals are in the loss's tail
    const auto run = test::simulate_run(simulation);
    const BatchProblem problem = test::batch_problem(run);
    const BatchOptions options;
    const Model model = make_model(problem, options, static_cast<int>(problem.frames.size()));
    State state = given_start(model, test::truth_of(run));
    Objective objective(model, options, {false, GetParam()});
    NormalEquations equations(model, make_layout(model, options));
    objective.linearize(state, equations);
    for (size_t j = 0; j < model.points.size(); j += 5)
        for (int c = 0; c < 3; ++c) {
            const auto cost = [&](double step) {
                State moved = state;
                moved.points[j](c) += step;
                return objective.evaluate(moved).total();
            };
            const double numeric = (cost(1e-6) - cost(-1e-6)) / 2e-6;
            EXPECT_NEAR(numeric, 2 * equations.b[j](c), 1e-4 * (1 + equations.b[j].norm()));
        }
}

INSTANTIATE_TEST_SUITE_P(All, BatchLoss, ::testing::Values("huber", "cauchy"),
                         [](const auto& param) { return param.param; });

// Features on edges: well placed across, badly along the edge, in a direction of their own each.
TEST(BatchResults, TextureCovariancesAreUsed) {
    double directional = 0, isotropic = 0, nees = 0;
    constexpr unsigned kSeeds = 24;
    for (unsigned seed = 1; seed <= kSeeds; ++seed) {
        auto simulation = short_run_options(seed);
        simulation.sigma_px = 0;
        const auto run = test::simulate_run(simulation);
        BatchProblem problem = test::batch_problem(run);
        std::mt19937 engine(seed);
        std::normal_distribution<double> normal;
        for (FeatureFrame& frame : problem.frames)
            for (FeatureObservation& feature : frame.features) {
                const double angle = 2.4 * static_cast<double>(feature.feature_id);
                const Eigen::Matrix2d R = Eigen::Rotation2Dd(angle).toRotationMatrix();
                const Eigen::Vector2d sigma(0.3, 5);
                const Eigen::Vector2d drawn{normal(engine), normal(engine)};  // in this order
                feature.uv_px += R * sigma.cwiseProduct(drawn);
                feature.covariance_shape = R * sigma.cwiseAbs2().asDiagonal() * R.transpose();
            }
        const auto error = [&](const BatchProblem& with, double* of_covariance) {
            BatchOptions options;
            options.loss = "none";
            options.outlier_sigmas = 0;
            const BatchResult result = estimate_batch(with, options, test::truth_of(run));
            const Estimate truth = test::truth_from(run, result.estimate.states.front().T_W_B);
            const StateEstimate& last = result.estimate.states.back();
            const Eigen::Vector3d e =
                test::state_error(last, truth.states.back()).segment<3>(kPosition);
            if (of_covariance)
                *of_covariance +=
                    e.dot(last.covariance.block<3, 3>(kPosition, kPosition).inverse() * e) / kSeeds;
            return e.norm();
        };
        directional += error(problem, &nees);
        for (FeatureFrame& frame : problem.frames)
            for (FeatureObservation& feature : frame.features)
                feature.covariance_shape = 12.5 * Eigen::Matrix2d::Identity();
        isotropic += error(problem, nullptr);
    }
    EXPECT_LT(directional, 0.6 * isotropic);
    EXPECT_NEAR(nees, 3, 3.3 * std::sqrt(2 * 3.0 / kSeeds));
}

// Features that follow nothing: the estimate is not given out as a result.
TEST(BatchResults, AStartThatMostObservationsContradictIsNoResult) {
    auto simulation = short_run_options();
    simulation.outliers = 0.8;
    const auto run = test::simulate_run(simulation);
    const BatchResult result = estimate_batch(test::batch_problem(run), {}, test::truth_of(run));
    EXPECT_FALSE(result.report.converged);
    EXPECT_TRUE(result.estimate.states.empty());
    EXPECT_NE(result.report.reason.find("contradict"), std::string::npos) << result.report.reason;
}

// Image-only, the scale stays what the start makes it, and the shape is as good.
TEST(BatchResults, ImageOnlyKeepsTheScaleOfItsStart) {
    auto simulation = short_run_options();
    simulation.seconds = 2;
    simulation.longest_track = 40;
    const auto run = test::simulate_run(simulation);
    const BatchProblem problem = test::batch_problem(run, false);
    for (const double scale : {1.0, 2.0}) {
        Estimate start = test::truth_of(run);
        const Eigen::Vector3d first = (start.states.front().T_W_B * run.rig.T_B_C).p;
        const auto scaled = [&](const Eigen::Vector3d& p) -> Eigen::Vector3d {
            return first + scale * (p - first);
        };
        for (StateEstimate& state : start.states) {
            const Pose T_W_C = state.T_W_B * run.rig.T_B_C;
            state.T_W_B = Pose{T_W_C.R, scaled(T_W_C.p)} * run.rig.T_B_C.inverse();
        }
        for (LandmarkEstimate& landmark : start.landmarks) landmark.p_W = scaled(landmark.p_W);
        const BatchResult result = estimate_batch(problem, {}, start);
        ASSERT_TRUE(result.report.converged) << result.report.reason;
        double farthest = 0, of_start = 0;
        for (size_t i = 0; i < result.estimate.states.size(); ++i) {
            const auto distance = [&](const Estimate& e) {
                return (e.states[i].T_W_B.p - e.states[0].T_W_B.p).norm();
            };
            farthest = std::max(farthest, distance(result.estimate));
            of_start = std::max(of_start, distance(start));
        }
        EXPECT_NEAR(farthest / of_start, 1, 0.02);
        EXPECT_FALSE(result.estimate.has_scale);
    }
}

}  // namespace
}  // namespace vio::batch
