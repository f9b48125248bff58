#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <random>

#include "libvio/base/errors.h"
#include "libvio/evaluation/evaluate.h"
#include "tests/unit/scratch_folder.h"

namespace vio {
namespace {

constexpr double kTight = 1e-9;

Similarity some_similarity(double s = 1.7) {
    return {s, so3::exp({0.4, -1.1, 2.0}), {3.0, -2.0, 0.5}};
}

/// A path that bends in all three directions, with stamps every 50 ms.
std::vector<TimedPose> winding_path(int n = 101) {
    std::vector<TimedPose> path;
    for (int i = 0; i < n; ++i) {
        const double u = 0.05 * i;
        path.push_back({1'403'636'579'000'000'000 + i * TimeNs{50'000'000},
                        {so3::exp({0.3 * std::sin(u), 0.2 * u, 0.5 * std::cos(1.3 * u)}),
                         {2 * std::cos(u), 1.5 * std::sin(u), 0.4 * std::sin(2.1 * u)}}});
    }
    return path;
}

std::vector<TimedPose> transformed(const Similarity& S, const std::vector<TimedPose>& path) {
    return apply(S, path);
}

TEST(Alignment, RecoversTheTransformationOfItsKind) {
    const auto path = winding_path();
    Eigen::Matrix3Xd p_E(3, static_cast<Eigen::Index>(path.size()));
    for (Eigen::Index i = 0; i < p_E.cols(); ++i) p_E.col(i) = path[static_cast<size_t>(i)].T_W_B.p;
    for (AlignmentKind kind :
         {AlignmentKind::kYawPosition, AlignmentKind::kSE3, AlignmentKind::kSim3}) {
        Similarity truth = some_similarity(kind == AlignmentKind::kSim3 ? 1.7 : 1.0);
        if (kind == AlignmentKind::kYawPosition) truth.R = so3::exp({0, 0, -2.5});
        Eigen::Matrix3Xd p_G(3, p_E.cols());
        for (Eigen::Index i = 0; i < p_E.cols(); ++i) p_G.col(i) = truth * p_E.col(i);
        const Alignment found = align(p_E, p_G, kind);
        EXPECT_EQ(found.status, AlignmentStatus::kDetermined);
        EXPECT_NEAR(found.S_G_E.s, truth.s, kTight) << to_string(kind);
        EXPECT_LT((found.S_G_E.R - truth.R).norm(), kTight) << to_string(kind);
        EXPECT_LT((found.S_G_E.p - truth.p).norm(), kTight) << to_string(kind);
    }
}

TEST(Alignment, YawMinimisesTheDistancesAmongAllYaws) {
    std::mt19937 engine(3);
    std::normal_distribution<double> normal;
    const auto noise = [&] { return normal(engine); };
    const Eigen::Matrix3Xd p_E = Eigen::Matrix3Xd::NullaryExpr(3, 40, noise);
    const Eigen::Matrix3Xd p_G = Eigen::Matrix3Xd::NullaryExpr(3, 40, noise);
    const Similarity S = align(p_E, p_G, AlignmentKind::kYawPosition).S_G_E;
    const auto cost = [&](double d_yaw, const Eigen::Vector3d& d_p) {
        const Similarity moved{1, so3::exp({0, 0, d_yaw}) * S.R, S.p + d_p};
        double sum = 0;
        for (Eigen::Index i = 0; i < p_E.cols(); ++i)
            sum += (p_G.col(i) - moved * p_E.col(i)).squaredNorm();
        return sum;
    };
    const double best = cost(0, Eigen::Vector3d::Zero());
    for (double d_yaw : {-3.0, -1.0, -1e-3, 1e-3, 1.0, 3.0})
        EXPECT_GT(cost(d_yaw, Eigen::Vector3d::Zero()), best);
    for (int axis = 0; axis < 3; ++axis)
        EXPECT_GT(cost(0, 1e-3 * Eigen::Vector3d::Unit(axis)), best);
}

TEST(Alignment, SaysWhichPathsLeaveItUndetermined) {
    const Eigen::Matrix3Xd one = Eigen::Vector3d(1, 2, 3);
    const Eigen::Matrix3Xd still = Eigen::Vector3d(1, 2, 3).replicate(1, 5);
    Eigen::Matrix3Xd line(3, 5), upright = Eigen::Matrix3Xd::Zero(3, 5);
    for (int i = 0; i < 5; ++i)
        line.col(i) = Eigen::Vector3d(1, 2, 3) + i * Eigen::Vector3d(2, 1, -1);
    upright.row(2) = line.row(0);
    using enum AlignmentKind;
    EXPECT_EQ(align(one, one, kSE3).status, AlignmentStatus::kTooFewPoints);
    EXPECT_LT((align(one, still.leftCols(1), kSE3).S_G_E * one.col(0) - one.col(0)).norm(), kTight);
    EXPECT_EQ(align(still, line, kSim3).status, AlignmentStatus::kStationary);
    EXPECT_EQ(align(line, 2 * line, kSE3).status, AlignmentStatus::kCollinear);
    const Alignment sim3 = align(line, 2 * line, kSim3);
    EXPECT_EQ(sim3.status, AlignmentStatus::kCollinear);
    EXPECT_NEAR(sim3.S_G_E.s, 2, kTight) << "a line tells the scale";
    EXPECT_EQ(align(line, line, kYawPosition).status, AlignmentStatus::kDetermined);
    EXPECT_EQ(align(upright, upright, kYawPosition).status, AlignmentStatus::kStationary);
    EXPECT_EQ(align(one, one, kNone).status, AlignmentStatus::kDetermined);
}

TEST(Association, InterpolatesOnTheGeodesicAndRefusesGaps) {
    const Pose A{so3::exp({0.1, 0.2, 0.3}), {1, 0, 0}};
    const Eigen::Vector3d turn(0.6, -0.3, 0.9);
    const Pose B{A.R * so3::exp(turn), {3, 4, 0}};
    const std::vector<TimedPose> truth = {{0, A}, {100, B}, {1000, A}};
    const std::vector<TimedPose> estimate = {{-1, A},  {0, A},   {25, A},
                                             {100, A}, {500, A}, {1000, A}};
    const auto pairs = associate(estimate, truth, 100);
    ASSERT_EQ(pairs.size(), 4u);  // before the first row and inside the gap: none
    EXPECT_EQ(pairs[1].estimate_idx, 2);
    EXPECT_LT((pairs[1].truth.R - A.R * so3::exp(0.25 * turn)).norm(), kTight);
    EXPECT_LT((pairs[1].truth.p - Eigen::Vector3d(1.5, 1, 0)).norm(), kTight);
    EXPECT_EQ(pairs[2].truth.p, B.p);
    EXPECT_EQ(pairs[3].estimate_idx, 5) << "exact stamps need no neighbour";
    const auto shifted = associate({{20, A}}, truth, 100, 30);
    ASSERT_EQ(shifted.size(), 1u);
    EXPECT_LT((shifted[0].truth.p - Eigen::Vector3d(2, 2, 0)).norm(), kTight);
}

TEST(Statistics, FollowTheirDefinitions) {
    const ErrorStatistics s = statistics({4, 1, 3, 2});
    EXPECT_EQ(s.count, 4);
    EXPECT_NEAR(s.mean, 2.5, kTight);
    EXPECT_NEAR(s.rmse, std::sqrt(30.0 / 4), kTight);
    EXPECT_NEAR(s.median, 2.5, kTight);
    EXPECT_NEAR(s.std_dev, std::sqrt(1.25), kTight);
    EXPECT_EQ(s.min, 1);
    EXPECT_EQ(s.max, 4);
    EXPECT_EQ(statistics({5, 1, 2}).median, 2);
    EXPECT_EQ(statistics({}).count, 0);
}

TEST(Evaluate, ATransformedCopyHasNoErrorUnderItsAlignmentAndTheRightScaleError) {
    const auto truth = winding_path();
    const Similarity S_G_E = some_similarity();
    const auto estimate = transformed(S_G_E.inverse(), truth);
    EvaluationOptions options;
    options.alignment = AlignmentKind::kSim3;
    const Evaluation e = evaluate(estimate, truth, options);
    EXPECT_LT(e.position.max, kTight);
    EXPECT_LT(e.rotation.max, 1e-7);  // the angle's own rounding: sqrt(2 epsilon)
    EXPECT_NEAR(e.scale_error.value(), 1 / 1.7 - 1, kTight);
    EXPECT_NEAR(e.truth_path_length, 1.7 * e.estimate_path_length, kTight);
    double length = 0;
    for (size_t i = 1; i < truth.size(); ++i)
        length += (truth[i].T_W_B.p - truth[i - 1].T_W_B.p).norm();
    EXPECT_NEAR(e.truth_path_length, length, kTight);
    EXPECT_EQ(e.associated_poses, 101);
    EXPECT_TRUE(e.warnings.empty());

    options.alignment = AlignmentKind::kSE3;  // the scale error does not depend on what is asked
    EXPECT_NEAR(evaluate(estimate, truth, options).scale_error.value(), 1 / 1.7 - 1, kTight);
}

TEST(Evaluate, RotationErrorIsTheAbsoluteAngleAfterTheAlignmentsRotation) {
    auto truth = winding_path();
    auto estimate = truth;
    for (size_t i = 0; i < estimate.size(); ++i)
        estimate[i].T_W_B.R *= so3::exp({0, (i % 2 ? 0.02 : -0.04), 0});
    estimate = transformed(some_similarity(1), estimate);
    const Evaluation e = evaluate(estimate, truth);
    EXPECT_LT(e.position.max, kTight);
    EXPECT_NEAR(e.rotation.max, 0.04, kTight);
    EXPECT_NEAR(e.rotation.mean, (51 * 0.04 + 50 * 0.02) / 101, kTight);
    EXPECT_NEAR(e.rotation.rmse, std::sqrt((51 * 0.0016 + 50 * 0.0004) / 101), kTight);
}

TEST(Evaluate, PositionErrorWithoutAlignmentIsTheDistance) {
    const auto truth = winding_path();
    auto estimate = truth;
    for (size_t i = 0; i < estimate.size(); ++i)
        estimate[i].T_W_B.p += (i % 2 ? 0.3 : 0.1) * Eigen::Vector3d(2, -1, 2) / 3;
    EvaluationOptions options;
    options.alignment = AlignmentKind::kNone;
    const Evaluation e = evaluate(estimate, truth, options);
    EXPECT_NEAR(e.position.mean, (51 * 0.1 + 50 * 0.3) / 101, kTight);
    EXPECT_NEAR(e.position.rmse, std::sqrt((51 * 0.01 + 50 * 0.09) / 101), kTight);
    EXPECT_NEAR(e.position.max, 0.3, kTight);
    EXPECT_NEAR(e.position.median, 0.1, kTight);
}

// evo's formulae written out: APE is |t(Q^-1 P)| and angle(Q^-1 P) of each pair; RPE is of
// E = (Q_i^-1 Q_j)^-1 (P_i^-1 P_j) for the pairs of a step.
TEST(Evaluate, AgreesWithTheFormulaeOfEvo) {
    std::mt19937 engine(11);
    std::normal_distribution<double> normal(0, 0.02);
    const auto truth = winding_path();
    auto estimate = truth;
    for (TimedPose& row : estimate)
        row.T_W_B = row.T_W_B.boxplus(Vector6d::NullaryExpr([&] { return normal(engine); }));
    EvaluationOptions options;
    options.alignment = AlignmentKind::kNone;
    options.rpe_distances_m = {1.0};
    options.rpe_times_s = {0.5};
    const Evaluation e = evaluate(estimate, truth, options);

    const auto homogeneous = [](const Pose& T) {
        Eigen::Matrix4d M = Eigen::Matrix4d::Identity();
        M.topLeftCorner<3, 3>() = T.R;
        M.topRightCorner<3, 1>() = T.p;
        return M;
    };
    std::vector<Eigen::Matrix4d> Q, P;
    for (const TimedPose& row : truth) Q.push_back(homogeneous(row.T_W_B));
    for (const TimedPose& row : estimate) P.push_back(homogeneous(row.T_W_B));
    const auto angle = [](const Eigen::Matrix4d& E) {
        return std::acos((E.topLeftCorner<3, 3>().trace() - 1) / 2);
    };
    const auto translation = [](const Eigen::Matrix4d& E) -> double {
        return E.topRightCorner<3, 1>().norm();
    };
    double ape_t = 0, ape_r = 0;
    for (size_t i = 0; i < Q.size(); ++i) {
        const Eigen::Matrix4d E = Q[i].inverse() * P[i];
        ape_t += std::pow(translation(E), 2);
        ape_r += std::pow(angle(E), 2);
    }
    EXPECT_NEAR(e.position.rmse, std::sqrt(ape_t / double(Q.size())), kTight);
    EXPECT_NEAR(e.rotation.rmse, std::sqrt(ape_r / double(Q.size())), kTight);

    const auto relative = [&](size_t i, size_t j) -> Eigen::Matrix4d {
        return (Q[i].inverse() * Q[j]).inverse() * (P[i].inverse() * P[j]);
    };
    double rpe_t = 0, rpe_r = 0;
    int pairs = 0;
    for (size_t i = 0; i + 10 < Q.size(); ++i, ++pairs) {
        rpe_t += std::pow(translation(relative(i, i + 10)), 2);
        rpe_r += std::pow(angle(relative(i, i + 10)), 2);
    }
    ASSERT_EQ(e.rpe_time.size(), 1u);
    EXPECT_EQ(e.rpe_time[0].translation.count, pairs);
    EXPECT_NEAR(e.rpe_time[0].translation.rmse, std::sqrt(rpe_t / pairs), kTight);
    EXPECT_NEAR(e.rpe_time[0].rotation.rmse, std::sqrt(rpe_r / pairs), kTight);

    std::vector<double> s = {0};
    for (size_t i = 1; i < Q.size(); ++i)
        s.push_back(s.back() + (Q[i] - Q[i - 1]).topRightCorner<3, 1>().norm());
    rpe_t = 0;
    pairs = 0;
    for (size_t i = 0; i + 1 < Q.size(); ++i) {
        size_t best = i + 1;
        for (size_t j = i + 2; j < Q.size(); ++j)
            if (std::abs(s[j] - s[i] - 1) < std::abs(s[best] - s[i] - 1)) best = j;
        if (std::abs(s[best] - s[i] - 1) > 0.1) continue;
        rpe_t += std::pow(translation(relative(i, best)), 2);
        ++pairs;
    }
    ASSERT_EQ(e.rpe_distance.size(), 1u);
    EXPECT_GT(pairs, 50);
    EXPECT_EQ(e.rpe_distance[0].translation.count, pairs);
    EXPECT_NEAR(e.rpe_distance[0].translation.rmse, std::sqrt(rpe_t / pairs), kTight);
}

TEST(Evaluate, CountsTheImagesThatHaveAPose) {
    const auto truth = winding_path();
    std::vector<TimedPose> estimate(truth.begin() + 30, truth.end());
    estimate.erase(estimate.begin() + 20, estimate.begin() + 30);  // images 50 to 59
    EvaluationOptions options;
    for (const TimedPose& row : truth) options.images.stamps.push_back(row.t);
    Completion c = evaluate(estimate, truth, options).completion;
    EXPECT_EQ(c.expected, 101);
    EXPECT_EQ(c.estimated, 61);
    options.images.start_offset_s = 2.0;  // from image 40 on
    c = evaluate(estimate, truth, options).completion;
    EXPECT_EQ(c.expected, 61);
    EXPECT_EQ(c.estimated, 51);
    options.images.lost = {estimate[40].t, estimate[41].t};
    const Evaluation with_lost = evaluate(estimate, truth, options);
    EXPECT_EQ(with_lost.completion.estimated, 49);
    EXPECT_EQ(with_lost.lost_poses, 2);
    EXPECT_NE(to_text(with_lost).find("2 of 61 poses are lost"), std::string::npos);
    options.images.lost.clear();
    options.images.stamps.clear();
    options.images.start_offset_s = 0;
    options.images.image_count = 122;
    EXPECT_NEAR(evaluate(estimate, truth, options).completion.share(), 0.5, kTight);
    options.images.images_with_pose = 30;  // not every pose is an image's
    EXPECT_EQ(evaluate(estimate, truth, options).completion.estimated, 30);
}

TEST(Evaluate, JudgesThePosesAfterTheStartByThemselves) {
    const auto truth = winding_path();
    auto estimate = truth;
    for (size_t i = 0; i < estimate.size(); ++i) estimate[i].T_W_B.p.x() += i < 40 ? 1 : 0.25;
    EvaluationOptions options;
    options.alignment = AlignmentKind::kNone;
    options.first_update = truth[40].t;
    const Evaluation e = evaluate(estimate, truth, options);
    ASSERT_TRUE(e.after_start);
    EXPECT_EQ(e.after_start->start_poses, 40);
    EXPECT_EQ(e.after_start->poses, static_cast<int>(truth.size()) - 40);
    EXPECT_NEAR(e.after_start->position.rmse, 0.25, kTight);
    EXPECT_NEAR(to_json(e)["after_start"]["position_m"]["rmse"].get<double>(), 0.25, kTight);
}

TEST(Evaluate, TruthOfAnotherPointOfTheBodyNeedsItsPose) {
    const Pose T_B_T{so3::exp({0.2, 0.1, -0.4}), {0.1, -0.2, 0.05}};
    const auto estimate = winding_path();
    auto truth = estimate;
    for (TimedPose& row : truth) row.T_W_B = row.T_W_B * T_B_T;
    EvaluationOptions options;
    options.T_B_T = T_B_T;
    const Evaluation e = evaluate(estimate, truth, options);
    EXPECT_LT(e.position.max, kTight);
    EXPECT_LT(e.rotation.max, 1e-7);
}

TEST(Evaluate, FramesThatAreTurnedAndQuaternionsInAnotherOrderAreNoted) {
    const auto estimate = winding_path();
    const auto notes = [&](const std::vector<TimedPose>& truth, const EvaluationOptions& options) {
        return evaluate(estimate, truth, options).warnings;
    };
    const Pose T_B_T{so3::exp({0.2, 0.1, -1.4}), {0, 0, 0}};
    auto turned = estimate, mixed = estimate;
    for (TimedPose& row : turned) row.T_W_B = row.T_W_B * T_B_T;
    for (TimedPose& row : mixed) {
        const Eigen::Quaterniond q(row.T_W_B.R);
        row.T_W_B.R = Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y()).toRotationMatrix();
    }
    ASSERT_EQ(notes(turned, {}).size(), 1u);
    double yaw = 0, pitch = 0, roll = 0;
    const std::string note = notes(turned, {})[0];
    ASSERT_EQ(std::sscanf(note.substr(note.find("--tracked")).c_str(),
                          "--tracked X Y Z %lf %lf %lf", &yaw, &pitch, &roll),
              3)
        << note;
    const Eigen::Matrix3d R = (Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
                               Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
                               Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()))
                                  .toRotationMatrix();
    EXPECT_LT((R - T_B_T.R).norm(), 1e-3) << "four digits are printed";
    EvaluationOptions told;
    told.T_B_T = T_B_T;
    EXPECT_TRUE(notes(turned, told).empty());
    ASSERT_EQ(notes(mixed, {}).size(), 1u);
    EXPECT_NE(notes(mixed, {})[0].find("quaternions' order"), std::string::npos);
}

TEST(Evaluate, TruthInAnotherUnitIsRefusedOnlyIfItsShapeIsTheSame) {
    const auto estimate = winding_path();
    const auto scaled = [&](double factor, double noise) {
        std::mt19937 engine(9);
        std::normal_distribution<double> normal(0, noise);
        auto truth = estimate;
        for (TimedPose& row : truth)
            row.T_W_B.p = factor * (row.T_W_B.p + Eigen::Vector3d(normal(engine), 0, 0));
        return truth;
    };
    const auto message = [&](const std::vector<TimedPose>& truth) {
        return test::error_of([&] { evaluate(estimate, truth); });
    };
    EXPECT_NE(message(scaled(1000, 0.01)).find("in millimetres"), std::string::npos);
    EXPECT_NE(message(scaled(100, 0.01)).find("in centimetres"), std::string::npos);
    EXPECT_NE(message(scaled(1e-3, 0.01)).find("the estimate's"), std::string::npos);
    EXPECT_EQ(message(scaled(300, 0.01)), "") << "no unit, so a bad estimate";
    EXPECT_EQ(message(scaled(1000, 0.5)), "") << "another path";
}

// An estimate whose errors are drawn from its covariances; the first pose defines the world.
struct Drawn {
    explicit Drawn(int n) : path(winding_path(n)), estimate(path), covariances(path.size()) {
        std::mt19937 engine(5);
        std::normal_distribution<double> normal;
        covariances[0].setZero();
        for (size_t i = 1; i < path.size(); ++i) {
            const Matrix6d A = 0.01 * Matrix6d::NullaryExpr([&] { return normal(engine); });
            covariances[i] = A * A.transpose() + 1e-5 * Matrix6d::Identity();
            const Vector6d e = covariances[i].llt().matrixL() *
                               Vector6d::NullaryExpr([&] { return normal(engine); });
            estimate[i].T_W_B = path[i].T_W_B.boxplus(-e);
        }
    }
    std::vector<TimedPose> path, estimate;
    std::vector<Matrix6d> covariances;
};

// Errors drawn from the covariance itself, in worlds that differ by yaw and position.
TEST(Evaluate, NeesOfErrorsDrawnFromTheirCovarianceIsTheirNumberOfFreedoms) {
    const int n = 4001;
    const auto [path, estimate, covariances] = Drawn(n);
    const Similarity S_G_E{1, so3::exp({0, 0, 1.1}), {5, 6, 7}};
    std::vector<TimedPose> truth = apply(S_G_E, path);
    const Nees nees = evaluate(estimate, truth, {}, covariances).nees.value();
    EXPECT_EQ(nees.pose.count, n - 1) << "the first pose defines the world: no covariance";
    // Standard error of the mean of n chi-square values: sqrt(2 dof / n); four of them. The errors
    // of rotation are small, so their nonlinearity stays far below.
    EXPECT_NEAR(nees.pose.mean, 6, 4 * std::sqrt(12.0 / n));
    EXPECT_NEAR(nees.position.mean, 3, 4 * std::sqrt(6.0 / n));
    EXPECT_NEAR(nees.rotation.mean, 3, 4 * std::sqrt(6.0 / n));
    EXPECT_NEAR(nees.pose.share_in_95, 0.95, 4 * std::sqrt(0.95 * 0.05 / n));

    // A truth that tracks another point and frame of the body: the same errors of the body.
    EvaluationOptions tracked;
    tracked.T_B_T = {so3::exp({0.4, -0.2, 0.9}), {0.3, -0.1, 0.5}};
    for (TimedPose& row : truth) row.T_W_B = row.T_W_B * tracked.T_B_T;
    const Nees same = evaluate(estimate, truth, tracked, covariances).nees.value();
    EXPECT_NEAR(same.pose.mean, nees.pose.mean, 1e-6);
    EXPECT_NEAR(same.position.mean, nees.position.mean, 1e-6);
}

// A world that is not level, and a reference that errs itself, say nothing of the covariances.
TEST(Evaluate, NeesIsLeftOutWithTheReasonWhereItMeansNothing) {
    const Drawn drawn(101);
    const auto judged = [&](const Eigen::Vector3d& turn, const EvaluationOptions& options) {
        const Similarity S_G_E{1, so3::exp(turn), {5, 6, 7}};
        return evaluate(drawn.estimate, apply(S_G_E, drawn.path), options, drawn.covariances);
    };
    const Evaluation upright = judged({0, 0, 1.1}, {});
    EXPECT_TRUE(upright.nees);
    EXPECT_EQ(upright.no_nees, "");
    const Evaluation on_its_side = judged({1.5, 0, 0}, {});
    EXPECT_FALSE(on_its_side.nees);
    EXPECT_NE(on_its_side.no_nees.find("z axis is 85.9 deg off"), std::string::npos)
        << on_its_side.no_nees;
    EXPECT_NE(to_text(on_its_side).find("NEES             left out: "), std::string::npos);
    EXPECT_EQ(to_json(on_its_side)["nees_left_out"], on_its_side.no_nees);
    EvaluationOptions odometry;
    odometry.truth_is_exact = false;
    EXPECT_FALSE(judged({0, 0, 1.1}, odometry).nees);
    EXPECT_NE(judged({0, 0, 1.1}, odometry).no_nees, "");
    // What the covariances allow is not the truth's fault.
    auto wide = drawn.covariances;
    for (Matrix6d& C : wide) C += 0.01 * Matrix6d::Identity();
    EXPECT_TRUE(
        evaluate(drawn.estimate, apply({1, so3::exp({0.1, 0, 0}), {5, 6, 7}}, drawn.path), {}, wide)
            .nees);
}

TEST(Evaluate, BadInputIsOneLineThatNamesItsPlace) {
    const auto good = winding_path();
    EvaluationOptions options;
    options.estimate_name = "est.tum";
    options.truth_name = "gt.csv";
    const auto expect = [&](const std::vector<TimedPose>& estimate,
                            const std::vector<TimedPose>& truth, const std::string& part) {
        const std::string message = test::error_of([&] { evaluate(estimate, truth, options); });
        EXPECT_NE(message.find(part), std::string::npos) << message;
        EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    };
    auto later = good;
    for (TimedPose& row : later) row.t += from_seconds(1000);
    expect(later, good, "no overlap in time");
    expect({}, good, "est.tum: holds no pose");
    expect({good[7]}, good, "only one pose");
    auto nan = good;
    nan[16].T_W_B.p.y() = std::nan("");
    expect(good, nan, "gt.csv (row 17,");
    auto unsorted = good;
    std::swap(unsorted[3], unsorted[4]);
    expect(unsorted, good, "est.tum (row 5,");
    auto twice = good;
    twice[9].t = twice[8].t;
    expect(twice, good, "repeats");
    auto skewed = good;
    skewed[2].T_W_B.R *= 1.1;
    expect(skewed, good, "not a rotation");
    auto line = good, still = good;
    for (size_t i = 0; i < line.size(); ++i) {
        line[i].T_W_B.p = double(i) * Eigen::Vector3d(1, 2, 3);
        still[i].T_W_B.p.setOnes();
    }
    options.alignment = AlignmentKind::kSim3;
    expect(line, line, "straight line");
    expect(still, good, "one place");
    options.alignment = AlignmentKind::kSE3;
    expect(good, line, "straight line");
    options.max_gap_s = 0.01;
    auto between = good;
    for (TimedPose& row : between) row.t += 25'000'000;
    expect(between, good, "wider gap");
}

// A machine's control points: the rest of the path counts neither for the alignment nor for errors.
TEST(Evaluate, JudgesAtGivenTimesAlone) {
    const auto path = winding_path();
    auto estimate = transformed(some_similarity(1), path);
    for (size_t i = 0; i < estimate.size(); ++i)
        if (i % 20 != 0) estimate[i].T_W_B.p.x() += 0.5;
    EvaluationOptions options;
    options.at_s = {4.01, 0, 1, 2.02, 3, 9};  // the nearest; the last is beyond the path
    const Evaluation e = evaluate(estimate, path, options);
    EXPECT_EQ(e.associated_poses, 5);
    EXPECT_LT(e.position.max, kTight);
    EXPECT_EQ(e.errors.back().estimate_idx, 80);
    options.at_s = {2, 2.01};
    EXPECT_NE(test::error_of([&] { evaluate(estimate, path, options); }).find("only one pose"),
              std::string::npos);
}

// The clocks differ; the path's speed makes the offset observable.
TEST(Evaluate, FindsTheTimeOffset) {
    const auto path = winding_path(201);
    for (const double offset : {0.137, -0.05, 0.0004}) {
        auto estimate = transformed(some_similarity(1), path);
        for (TimedPose& row : estimate) row.t -= from_seconds(offset);
        EvaluationOptions options;
        options.time_offset_search_s = 0.3;
        const Evaluation e = evaluate(estimate, path, options);
        // Interpolation cuts the corners of the path by up to a h^2 / 8 = 1 mm at 50 ms; the offset
        // that it moves is far smaller since the cuts cancel.
        EXPECT_NEAR(e.time_offset_s, offset, 2e-4);
        EXPECT_TRUE(e.time_offset_estimated);
    }
    EvaluationOptions options;
    options.time_offset_search_s = 0.1;
    auto late = path;
    for (TimedPose& row : late) row.t += from_seconds(0.4);
    const std::string message = test::error_of([&] { evaluate(late, path, options); });
    EXPECT_NE(message.find("search farther"), std::string::npos) << message;
}

TEST(Evaluate, GapsOfTheTruthAreStatedAndNotBridged) {
    const auto estimate = winding_path();
    auto truth = estimate;
    for (TimedPose& row : truth) row.t += 10'000'000;  // between the images
    truth.erase(truth.begin() + 40, truth.begin() + 60);
    const Evaluation e = evaluate(estimate, truth);
    EXPECT_NEAR(e.max_gap_s, 0.125, kTight);
    ASSERT_EQ(e.gaps.size(), 1u);
    EXPECT_EQ(e.gaps[0].from, truth[39].t);
    EXPECT_EQ(e.gaps[0].to, truth[40].t);
    EXPECT_EQ(e.associated_poses, 101 - 1 - 21);  // the first image is before the truth
    ASSERT_EQ(e.warnings.size(), 2u);
    EXPECT_NE(e.warnings[1].find("1 gap of more than 0.125 s"), std::string::npos);
}

// An estimate that is too large by 1 % and turns too far by 2 mrad per metre on a straight road.
TEST(Evaluate, DriftIsTheErrorByTheDistance) {
    std::vector<TimedPose> truth, estimate;
    for (int i = 0; i <= 200; ++i) {
        const TimeNs t = i * TimeNs{100'000'000};
        truth.push_back({t, {Eigen::Matrix3d::Identity(), {0.5 * i, 0, 0}}});
        estimate.push_back({t, {so3::exp({0.001 * i, 0, 0}), {0.505 * i, 0, 0}}});
    }
    EvaluationOptions options;
    options.alignment = AlignmentKind::kNone;
    const Evaluation e = evaluate(estimate, truth, options);
    ASSERT_EQ(e.rpe_distance.size(), 5u);
    ASSERT_TRUE(e.drift.has_value());
    EXPECT_NEAR(e.drift->translation, 0.01, kTight);
    EXPECT_NEAR(e.drift->rotation, 0.002, kTight);
}

TEST(Evaluate, TableHasALineForEach) {
    const auto truth = winding_path();
    auto estimate = truth;
    for (TimedPose& row : estimate) row.T_W_B.p *= 1.02;
    EvaluationOptions options;
    options.alignment = AlignmentKind::kSim3;
    options.estimate_name = "first";
    std::vector<Evaluation> evaluations = {evaluate(estimate, truth, options)};
    options.estimate_name = "second";
    options.truth_has_attitude = false;
    evaluations.push_back(evaluate(truth, truth, options));
    const std::string table = to_table(evaluations);
    EXPECT_NE(table.find("first"), std::string::npos);
    EXPECT_NE(table.find("+2.00"), std::string::npos) << table;
    EXPECT_NE(table.find("second"), std::string::npos);
    EXPECT_NE(table.find("alignment Sim(3)"), std::string::npos);
}

TEST(Evaluate, ReportsSayTheSameInTextAndJson) {
    const auto truth = winding_path();
    auto estimate = truth;
    for (TimedPose& row : estimate) row.T_W_B.p.x() += 0.25;
    EvaluationOptions options;
    options.alignment = AlignmentKind::kNone;
    options.images.image_count = 101;
    const Evaluation e = evaluate(estimate, truth, options);
    const std::string text = to_text(e);
    EXPECT_NE(text.find("position            0.2500    0.2500"), std::string::npos) << text;
    EXPECT_NE(text.find("completion       100.0 %"), std::string::npos) << text;
    const auto json = nlohmann::json::parse(to_json(e).dump());
    EXPECT_NEAR(json["position_m"]["rmse"].get<double>(), 0.25, kTight);
    EXPECT_EQ(json["completion"]["share"], 1.0);
    EXPECT_NEAR(json["scale_error"].get<double>(), 0, kTight);
    EXPECT_EQ(json["alignment"], "none");
}

}  // namespace
}  // namespace vio
