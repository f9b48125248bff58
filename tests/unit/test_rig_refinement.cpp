// Parts of the rig among the batch estimator's unknowns.
#include <gtest/gtest.h>

#include <algorithm>

#include "libvio/batch/marginals.h"
#include "libvio/batch/minimize.h"
#include "libvio/batch/scale_noise.h"
#include "libvio/batch/start.h"
#include "tests/simulated_batch.h"
#include "tests/unit/dense_information.h"

namespace vio::batch {
namespace {

class RigRefined : public ::testing::Test {
 protected:
    RigRefined() {
        test::SimulatedRunOptions simulation;
        simulation.seconds = 1;
        simulation.features = 30;
        simulation.longest_track = 8;
        run_ = simulate_run(simulation);
        problem_ = test::batch_problem(run_);
        for (size_t id = 0; id < run_.point_of_feature.size(); id += 3)
            problem_.fiducials[static_cast<FeatureId>(id)] = {
                run_.points[run_.point_of_feature[id]], Eigen::Matrix3d::Identity() * 1e-4};
        options_.loss = "none";
        options_.intrinsics_sigma = 3;
        options_.extrinsics_rotation_sigma = 1;
        options_.extrinsics_position_sigma = 0.02;
        options_.time_offset_sigma = 0.004;
        model_ = make_model(problem_, options_, static_cast<int>(problem_.frames.size()));
        state_ = given_start(model_, test::truth_of(run_));
        rig_.emplace(problem_, model_, rig_unknowns(problem_.rig, options_),
                     rig_sigmas(problem_.rig, options_));
        equations_.emplace(model_, make_layout(model_, options_));
        objective_.emplace(model_, options_, Stage{});
    }

    double linearize() {
        const double cost = objective_->linearize(state_, *equations_).total();
        rig_->linearize(*objective_, state_, *equations_);
        return cost + rig_->cost();
    }

    test::SimulatedRun run_;
    BatchProblem problem_;
    BatchOptions options_;
    Model model_;
    State state_;
    std::optional<RigRefinement> rig_;
    std::optional<NormalEquations> equations_;
    std::optional<Objective> objective_;
};

// What is stated of the rig adds its distance from it, in standard deviations, squared.
TEST_F(RigRefined, WhatIsStatedDrawsBack) {
    const Eigen::VectorXd sigmas = rig_->sigmas();
    const Eigen::Index n = sigmas.size();
    ASSERT_EQ(n, 16);
    ASSERT_EQ(static_cast<Eigen::Index>(rig_->names().size()), n);
    ASSERT_TRUE(rig_->move(30 * sigmas.cwiseProduct(Eigen::VectorXd::LinSpaced(n, -1, 1)) /
                               std::sqrt(static_cast<double>(n)),
                           *objective_));
    linearize();
    const Eigen::VectorXd gradient = equations_->rig->gradient;
    const Eigen::VectorXd of_images =
        objective_->linearize_rig(state_, rig_unknowns(problem_.rig, options_), *equations_)
            .gradient;
    const double scale = (gradient - of_images).cwiseProduct(sigmas).norm();
    for (Eigen::Index k = 0; k < n; ++k) {
        Eigen::VectorXd step = Eigen::VectorXd::Zero(n);
        double cost[2];
        for (const int sign : {0, 1}) {
            step(k) = (sign ? 1e-4 : -1e-4) * sigmas(k);
            ASSERT_TRUE(rig_->move(step, *objective_));
            cost[sign] = rig_->cost();
            rig_->take_back(*objective_);
        }
        EXPECT_NEAR((cost[1] - cost[0]) / 2e-4 / 2, (gradient(k) - of_images(k)) * sigmas(k),
                    1e-5 * scale)
            << rig_->names()[static_cast<size_t>(k)];
    }
}

// A step of everything lowers the cost by what it promises, and leads to the minimum.
TEST_F(RigRefined, StepsLeadToTheMinimum) {
    minimize(*objective_, *equations_, {}, state_, &*rig_);
    const double least = linearize();
    const Eigen::VectorXd found = rig_->change();
    ASSERT_TRUE(rig_->move(0.3 * rig_->sigmas(), *objective_));
    double cost = linearize();
    for (int i = 0; i < 4; ++i) {
        Step step;
        ASSERT_TRUE(equations_->solve(0, step));
        const double promised = equations_->predicted_decrease(step);
        State next;
        objective_->apply(state_, step, equations_->layout(), next);
        ASSERT_TRUE(rig_->move(step.rig, *objective_));
        state_ = next;
        const double now = linearize();
        if (i == 1) {
            EXPECT_NEAR(cost - now, promised, 0.05 * promised + 1e-6);
        }
        cost = now;
    }
    EXPECT_NEAR(cost, least, 1e-3);
    EXPECT_LT((rig_->change() - found).cwiseQuotient(rig_->sigmas()).norm(), 1e-2);
}

// The rig's covariance, and the joint one of the last state and its points, are blocks of the
// inverse of the whole information matrix, the rig's unknowns among the others; scale widened or
// not.
TEST_F(RigRefined, JointCovariancesAreThoseOfTheDenseInverse) {
    minimize(*objective_, *equations_, {}, state_, &*rig_);
    linearize();
    const Layout& layout = equations_->layout();
    const int n = equations_->matrix.size();
    Eigen::MatrixXd dense = test::dense_covariance(*equations_, model_);
    ASSERT_TRUE(equations_->factorize());
    ASSERT_TRUE(equations_->rig_solution());
    const auto close = [](const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
        EXPECT_LT((a - b).norm(), 1e-6 * b.norm());
    };
    const Eigen::VectorXd information = rig_->sigmas().cwiseInverse();
    const auto r = information.size();
    close(information.asDiagonal() * equations_->rig_solution()->covariance *
              information.asDiagonal(),
          information.asDiagonal() * dense.bottomRightCorner(r, r) * information.asDiagonal());
    std::map<FeatureId, int> column;
    for (size_t j = 0; j < model_.points.size(); ++j)
        column[model_.points[j].id] = n + 3 * static_cast<int>(j);
    const int gyro = layout.index(model_.frames() - 1, kGyroBias);
    for (const bool widened : {false, true}) {
        SCOPED_TRACE(widened);
        if (widened) {
            constexpr double kFactor = 5;
            const Eigen::VectorXd c = scale_reading(model_, state_, *equations_);
            test::widen(dense, c, kFactor);
            equations_->widen(c, kFactor);
        }
        const BatchTail tail = publish_tail(model_, *objective_, state_, *equations_);
        ASSERT_EQ(tail.with_rig.cols(), r);
        for (size_t a = 0; a < tail.landmarks.size(); ++a) {
            const int k = column.at(tail.landmarks[a].id), at = 15 + 3 * static_cast<int>(a);
            close(tail.landmarks[a].covariance, dense.block<3, 3>(k, k));
            EXPECT_LT(
                (tail.covariance.block<3, 3>(at, kGyroBias) - dense.block<3, 3>(k, gyro)).norm(),
                1e-6 * std::sqrt(dense.block<3, 3>(k, k).norm() *
                                 dense.block<3, 3>(gyro, gyro).norm()));
            close(tail.with_rig.middleRows<3>(at) * information.asDiagonal(),
                  dense.block(k, dense.cols() - r, 3, r) * information.asDiagonal());
        }
    }
}

// However far the others are: hills on the horizon are no reason to leave out the trees before
// them.
TEST_F(RigRefined, OnlyPointsInACameraStandInOne) {
    for (size_t j = 1; j < state_.points.size(); ++j)
        if (!model_.points[j].fiducial) state_.points[j] *= j % 3 == 1 ? 1 : 1e7;
    EXPECT_TRUE(points_at_cameras(model_, state_).empty());
    const auto it = std::find_if(model_.points.begin(), model_.points.end(),
                                 [](const Point& p) { return !p.fiducial; });
    const auto j = static_cast<size_t>(it - model_.points.begin());
    const Observation& seen = model_.observations[it->first_observation + 1];
    const InertialState& I = state_.frames[seen.frame_idx].motion;
    state_.points[j] = (Pose{I.R, I.p} * model_.T_I_C).p + Eigen::Vector3d(1e-9, 0, 0);
    EXPECT_EQ(points_at_cameras(model_, state_), std::vector<int>{static_cast<int>(j)});
}

// Noise can bring a point near where its cameras stand together, and nowhere else.
TEST_F(RigRefined, ANearPointIsDoubtedWhereItsCamerasStandTogether) {
    constexpr double kTogether = 1e-3;  // [m]
    EXPECT_TRUE(points_near_by_noise(model_, state_).empty());
    const auto it = std::find_if(model_.points.begin(), model_.points.end(),
                                 [](const Point& p) { return !p.fiducial; });
    const auto j = static_cast<size_t>(it - model_.points.begin());
    Observation* seen = &model_.observations[it->first_observation];
    const auto centre = [&](const Observation& o) {
        const InertialState& I = state_.frames[o.frame_idx].motion;
        return (Pose{I.R, I.p} * model_.T_I_C).p;
    };
    state_.points[j] = centre(seen[0]) + (state_.points[j] - centre(seen[0])) / 4;
    EXPECT_TRUE(points_near_by_noise(model_, state_).empty());
    for (int k = 2; k < it->observation_count; ++k) seen[k].active = false;
    state_.frames[seen[1].frame_idx].motion.p +=
        centre(seen[0]) - centre(seen[1]) + Eigen::Vector3d::Constant(kTogether);
    EXPECT_EQ(points_near_by_noise(model_, state_), std::vector<int>{static_cast<int>(j)});
}

// The offset must not stop where the readings do.
TEST_F(RigRefined, ImagesThatMayLieOutsideTheReadingsAreLeftOut) {
    const TimeNs offset = from_seconds(problem_.rig.time_offset);
    const TimeNs first = problem_.imu.readings().front().t, last = problem_.imu.readings().back().t;
    const double sigma = 0.02;
    const BatchProblem rest = without_images_at_ends(problem_, sigma);
    ASSERT_LT(rest.frames.size(), problem_.frames.size());
    ASSERT_GT(rest.frames.size(), problem_.frames.size() / 2);
    for (const FeatureFrame& frame : rest.frames) {
        EXPECT_GE(frame.t + offset - from_seconds(3 * sigma), first);
        EXPECT_LE(frame.t + offset + from_seconds(3 * sigma), last);
    }
}

TEST_F(RigRefined, WhatCannotBeRefinedIsRefused) {
    problem_.imu = {};
    EXPECT_THROW(estimate_batch(problem_, options_), InputError);
}

}  // namespace
}  // namespace vio::batch
