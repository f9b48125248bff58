// Rest, starts without motion, loss of images or readings: the recursive estimator's covariance and
// its word "lost" tell the truth throughout.
#include <gtest/gtest.h>

#include <sstream>

#include "libvio/base/angles.h"
#include "libvio/geometry/alignment.h"
#include "libvio/recursive/observation.h"
#include "libvio/recursive/rest.h"
#include "libvio/recursive/rest_update.h"
#include "libvio/recursive/start_at_rest.h"
#include "libvio/simulation/scenario.h"
#include "tests/draws.h"
#include "tests/feed.h"
#include "tests/simulated_run.h"
#include "tests/unit/numeric_jacobian.h"

namespace vio {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

const std::string kDatasets = std::string(VIO_SOURCE_DIR) + "/datasets/";

struct Judgements {
    int at_rest = 0, resting = 0, moving_at_rest = 0, moving = 0;
};

// Shows a detector all readings and images, and each image's index to `look`.
template <typename Look>
void watch(const Simulation& simulation, const Look& look) {
    RestDetector detector(simulation.rig().imu_noise, simulation.options().track_model.noise_px);
    const auto& frames = simulation.tracks().frames;
    std::size_t next = 0;
    for (const ImuReading& reading : simulation.imu()) {
        for (; next < frames.size() && frames[next].t <= reading.t; ++next) {
            detector.add(frames[next], frames[next].t);
            look(next, detector);
        }
        detector.add(reading);
    }
}

// Of a scenario, image by image, against the true motion of the second before.
Judgements judged(const std::string& file, const std::vector<std::string>& assignments = {}) {
    const Simulation simulation(ScenarioOptions::from_file(kDatasets + file, assignments));
    const auto& frames = simulation.tracks().frames;
    Judgements result;
    watch(simulation, [&](std::size_t image, const RestDetector& detector) {
        const StateEstimate& now = simulation.truth()[image];
        double moved = 0, fastest = 0;
        for (std::size_t k = image; k < frames.size(); --k) {
            const StateEstimate& then = simulation.truth()[k];
            if (to_seconds(now.t - then.t) > 1.5) break;
            moved = std::max(moved, then.T_W_B.boxminus(now.T_W_B).norm());
            fastest = std::max(fastest, then.v_W.norm());
        }
        if (to_seconds(frames[image].t - frames[0].t) < 3) return;
        const bool rests = moved < 1e-4 && fastest < 1e-4;
        const bool moves = fastest > 0.02;
        result.resting += rests;
        result.at_rest += rests && detector.at_rest();
        result.moving += moves;
        result.moving_at_rest += moves && detector.at_rest() && now.v_W.norm() > 0.02;
    });
    return result;
}

// Four tests at 99.9 % with a margin: a rest is hardly ever missed; hovering is none.
TEST(RestDetector, TellsStopsFromDrivingAndHovering) {
    const Judgements rover = judged("rover_sparse.ini", {"camera.count=400"});
    EXPECT_GT(rover.resting, 20);
    EXPECT_GE(rover.at_rest, 0.95 * rover.resting);
    EXPECT_GT(rover.moving, 200);
    EXPECT_EQ(rover.moving_at_rest, 0);
    const Judgements hover = judged("stress/hover.ini", {"camera.count=400"});
    EXPECT_GT(hover.moving, 100);
    EXPECT_EQ(hover.at_rest + hover.moving_at_rest, 0);
}

// A departure so slow that two pixels' noise hides it at first: what has passed for rest is within
// what the detector says it cannot see, for a camera that looks at the floor.
TEST(RestDetector, KnowsWhatItCannotSee) {
    const Simulation simulation(ScenarioOptions::from_file(
        kDatasets + "crane.ini",
        {"trajectory.shake_angle=0", "trajectory.shake_distance=0", "camera.count=400"}));
    int passed_for_rest = 0;
    double sum2 = 0, worst = 0;
    watch(simulation, [&](std::size_t image, const RestDetector& detector) {
        const StateEstimate& truth = simulation.truth()[image];
        if (!detector.at_rest() || truth.v_W.norm() < 1e-3) return;
        const double ratio =
            truth.v_W.norm() /
            detector.hidden_speed(simulation.rig().camera->angular_resolution(), truth.T_W_B.p.z());
        sum2 += ratio * ratio;
        worst = std::max(worst, ratio);
        ++passed_for_rest;
    });
    ASSERT_GT(passed_for_rest, 5);
    EXPECT_LT(std::sqrt(sum2 / passed_for_rest), 1.5);
    EXPECT_LT(worst, 4);
}

// Tilt and accelerometer bias, which stillness cannot tell apart, with the joint covariance that
// the start states: five degrees of freedom, 400 seeds, bounds at four standard deviations of the
// mean, sqrt(2 / 400 / 5).
TEST(StartAtRest, ErrorsMatchTheirCovariance) {
    std::mt19937 random(7);
    std::normal_distribution<double> normal;
    const auto noise3 = [&] { return test::normal_vector<3>(normal, random); };
    Rig rig = test::simulate_run({.seconds = 0.2}).rig;
    BatchOptions priors;
    priors.accel_bias_sigma = 0.1;
    constexpr int kSeeds = 400;
    double nees = 0, gyro = 0;
    for (int i = 0; i < kSeeds; ++i) {
        const Eigen::Matrix3d R_W_B = (Eigen::AngleAxisd(0.5 * normal(random), Vector3d::UnitY()) *
                                       Eigen::AngleAxisd(0.8 * normal(random), Vector3d::UnitX()))
                                          .toRotationMatrix();
        const Vector3d bias = 0.1 * noise3(), gyro_bias = 0.01 * noise3();
        Stillness rest;
        rest.to = 1'000'000'000;
        rest.accel = (R_W_B * rig.T_B_I.R).transpose() * Vector3d(0, 0, 9.81) + bias +
                     rig.imu_noise.accel_noise_density * noise3();
        rest.gyro = gyro_bias + rig.imu_noise.gyro_noise_density * noise3();
        const BatchTail tail = start_at_rest(rest, 5, rig, priors);
        EXPECT_EQ(tail.state.t, 5);
        // Where the true vertical is, whatever the yaw.
        const Vector3d up = tail.state.T_W_B.R * R_W_B.transpose() * Vector3d::UnitZ();
        Eigen::Matrix<double, 5, 15> pick = Eigen::Matrix<double, 5, 15>::Zero();
        pick.block<2, 3>(0, kRotation) = tail.state.T_W_B.R.topRows<2>();
        pick.block<3, 3>(2, kAccelBias).setIdentity();
        Eigen::Matrix<double, 5, 1> error;
        error << up.y(), -up.x(), bias - tail.state.accel_bias;
        const Eigen::Matrix<double, 5, 5> P = pick * tail.covariance * pick.transpose();
        nees += error.dot(P.ldlt().solve(error)) / 5;
        const Vector3d e = gyro_bias - tail.state.gyro_bias;
        gyro += e.squaredNorm() / tail.covariance(kGyroBias, kGyroBias) / 3;
    }
    EXPECT_NEAR(nees / kSeeds, 1, 4 * std::sqrt(2.0 / kSeeds / 5));
    EXPECT_NEAR(gyro / kSeeds, 1, 4 * std::sqrt(2.0 / kSeeds / 3));
}

// A start continues a path whose yaw and position are uncertain: its covariance is that of samples
// of both.
TEST(Continued, CovarianceIsThatOfSamples) {
    std::mt19937 random(8);
    std::normal_distribution<double> normal;
    const test::SimulatedRun run = test::simulate_run({.seconds = 1});
    BatchTail start = test::sampled_start(run, 5, 3);
    start.landmarks.resize(2);
    start.covariance = MatrixXd(start.covariance.topLeftCorner(21, 21));
    const Pose from{so3::exp({0, 0, 0.4}), {0.2, 0.1, 0}};
    StateEstimate known = run.truth[0];
    known.covariance.topLeftCorner<6, 6>() = 1e-4 * Matrix6d::Identity();
    const BatchTail joined = continued(start, from, known);
    EXPECT_LT((joined.state.T_W_B.p - known.T_W_B.p).norm(),
              (start.state.T_W_B.p - from.p).norm() + 1e-12);

    const MatrixXd L = start.covariance.llt().matrixL();
    MatrixXd sum = MatrixXd::Zero(21, 21);
    constexpr int kSamples = 20000;
    for (int i = 0; i < kSamples; ++i) {
        VectorXd d(21);
        for (int k = 0; k < 21; ++k) d(k) = normal(random);
        d = (L * d).eval();
        BatchTail other = start;
        other.state.T_W_B = start.state.T_W_B.boxplus(d.head<6>());
        other.state.v_W += d.segment<3>(kVelocity);
        for (int k = 0; k < 2; ++k) other.landmarks[k].p_W += d.segment<3>(15 + 3 * k);
        StateEstimate there = known;
        Vector6d e;
        for (int k = 0; k < 6; ++k) e(k) = 0.01 * normal(random);
        there.T_W_B = known.T_W_B.boxplus(e);
        const BatchTail sample = continued(other, from, there);
        VectorXd error(21);
        error << sample.state.T_W_B.boxminus(joined.state.T_W_B),
            sample.state.v_W - joined.state.v_W, d.segment<6>(kGyroBias),
            sample.landmarks[0].p_W - joined.landmarks[0].p_W,
            sample.landmarks[1].p_W - joined.landmarks[1].p_W;
        sum += error * error.transpose() / kSamples;
    }
    const VectorXd scale = joined.covariance.diagonal().cwiseSqrt().cwiseInverse();
    const MatrixXd difference = scale.asDiagonal() * (sum - joined.covariance) * scale.asDiagonal();
    EXPECT_LT(difference.cwiseAbs().maxCoeff(), 6 / std::sqrt(double(kSamples)));
}

struct Fault {
    double from = 10, seconds = 0;
    /// kNothing: the sensors rest, and go on where they were.
    enum { kDark, kNoImages, kNoReadings, kNothing } kind = kDark;
    bool starts_itself = false;  ///< from a prefix, else from a given state at the tenth image
    std::string output = "images";
};

struct FaultOutcome {
    int images = 0, lost = 0, lost_at_end = 0, states = 0;
    int lost_later = 0, later = 0;  // from three seconds after the fault on
    std::vector<StateEstimate> path;
    bool at_last_message = false;  // there is an estimate
    double worst = 0;              // squared Mahalanobis distance of position, where not lost
    std::string said;
};

FaultOutcome with_fault(const Fault& fault, unsigned seed) {
    test::SimulatedRunOptions simulated;
    simulated.seed = seed;
    simulated.seconds = 30;
    test::SimulatedRun run = test::simulate_run(simulated);
    const TimeNs begin = run.frames.front().t + from_seconds(fault.from);
    const auto inside = [&](TimeNs t) {
        return t >= begin && t < begin + from_seconds(fault.seconds);
    };
    if (fault.kind == Fault::kNoReadings)
        std::erase_if(run.readings, [&](const ImuReading& r) { return inside(r.t); });
    if (fault.kind == Fault::kNoImages)
        std::erase_if(run.frames, [&](const FeatureFrame& f) { return inside(f.t); });
    if (fault.kind != Fault::kNoReadings)
        for (FeatureFrame& frame : run.frames) {
            if (fault.kind != Fault::kNothing && inside(frame.t)) frame.features.clear();
            if (frame.t < begin) continue;
            for (FeatureObservation& f : frame.features) f.feature_id += 1'000'000;
        }
    if (fault.kind == Fault::kNothing) {
        const auto shift = [&](auto& measured) {
            for (auto& m : measured)
                if (m.t >= begin) m.t += from_seconds(fault.seconds);
        };
        shift(run.readings);
        shift(run.frames);
        shift(run.truth);
    }
    IekfOptions options;
    options.output = fault.output;
    Iekf filter(run.rig, options, {});
    const int first = fault.starts_itself ? 0 : 10;
    if (!fault.starts_itself) filter.start(test::sampled_start(run, first, seed + 100));
    test::feed(filter, run.readings, run.frames, 0, static_cast<std::size_t>(first));
    FaultOutcome outcome;
    outcome.at_last_message = !filter.estimate().states.empty();
    filter.finish();
    outcome.images = static_cast<int>(run.frames.size()) - first - 1;
    std::size_t i = 0;
    std::optional<Similarity> S;  // to the world of a filter that started itself
    const TimeNs later = begin + from_seconds(fault.seconds + 3);
    outcome.path = filter.estimate().states;
    for (const StateEstimate& state : outcome.path) {
        if (fault.output != "images") break;
        outcome.later += state.t > later;
        outcome.lost_later += state.lost && state.t > later;
        ++outcome.states;
        outcome.lost += state.lost;
        outcome.lost_at_end = state.lost ? outcome.lost_at_end + 1 : 0;
        while (run.truth[i].t < state.t) ++i;
        if (!S)
            S = fault.starts_itself ? align_yaw_position(run.truth[i].T_W_B, state.T_W_B)
                                    : Similarity{};
        const Vector3d e = (*S * run.truth[i].T_W_B).p - state.T_W_B.p;
        const Eigen::Matrix3d P = state.covariance.block<3, 3>(kPosition, kPosition);
        EXPECT_TRUE(state.covariance.allFinite());
        const bool world_begins = P.diagonal().minCoeff() < 1e-10;
        if (!state.lost && !world_begins)
            outcome.worst = std::max(outcome.worst, e.dot(P.ldlt().solve(e)));
    }
    for (const StatusEntry& entry : filter.status())
        outcome.said += std::to_string(to_seconds(entry.t - run.frames.front().t)).substr(0, 5) +
                        " s: " + entry.text + "\n";
    return outcome;
}

// Whatever is missing for a while, there is a state for each image, it is never wrong by more than
// four sigma unless it says that it is lost, and in the end the motion is known again.
TEST(Recovery, StaysHonestAndComesBackAfterImagesOrReadingsWereMissing) {
    const Fault faults[] = {{10, 2, Fault::kDark},       {10, 10, Fault::kDark},
                            {10, 5, Fault::kNoImages},   {10, 0.5, Fault::kNoReadings},
                            {10, 5, Fault::kNoReadings}, {10, 30, Fault::kNothing},
                            {10, 600, Fault::kNothing}};
    for (const Fault& fault : faults) {
        const FaultOutcome outcome = with_fault(fault, 2);
        SCOPED_TRACE("kind " + std::to_string(fault.kind) + ", " + std::to_string(fault.seconds) +
                     " s\n" + outcome.said);
        EXPECT_GE(outcome.states, outcome.images - 1);
        EXPECT_LT(outcome.worst, 16 + 3);  // four sigma of three components
        EXPECT_EQ(outcome.lost_at_end, 0);
        if (fault.seconds < 15 || fault.kind == Fault::kNothing) {
            EXPECT_GT(outcome.later, 100);
            EXPECT_LT(outcome.lost_later, 0.1 * outcome.later);
        }
        if (fault.kind == Fault::kDark) {
            EXPECT_GT(outcome.lost, 20 * (fault.seconds - 1));
        }
    }
}

// A restart joins on to the same image, however many states there are between images.
TEST(Recovery, StatesAtReadingsChangeNothing) {
    const Fault fault{10, 30, Fault::kNothing, /*starts_itself=*/true};
    Fault often = fault;
    often.output = "readings";
    const FaultOutcome few = with_fault(fault, 2), many = with_fault(often, 2);
    SCOPED_TRACE(many.said);
    ASSERT_NE(few.said.find("restarted from a prefix"), std::string::npos);
    ASSERT_GT(many.path.size(), 2 * few.path.size());
    std::size_t i = 0;
    for (const StateEstimate& state : few.path) {
        while (i + 1 < many.path.size() && many.path[i].t < state.t) ++i;
        ASSERT_EQ(many.path[i].t, state.t);
        EXPECT_LT(many.path[i].T_W_B.boxminus(state.T_W_B).norm(), 1e-6);
    }
}

// Rounds of 40 m radius at 11 to 15 m/s on grass with boulders and hills, consumer IMU.
ScenarioOptions fast_drive() {
    std::ostringstream waypoints;
    for (int i = 0; i <= 40; ++i) {
        const double t = 0.5 * i, angle = (13 * t + 4 * std::sin(0.5 * t)) / 40;
        waypoints << (i > 0 ? ", " : "") << t << ' ' << 40 * std::sin(angle) << ' '
                  << -40 * std::cos(angle) << ' ' << 0.03 * std::sin(1.7 * t) << ' '
                  << angle / kDegree << ' ' << 0.6 * std::sin(2.3 * t) << ' '
                  << 0.8 * std::sin(1.9 * t + 1);
    }
    return ScenarioOptions::from_file(
        kDatasets + "stress/base.ini",
        {"trajectory.waypoints=" + waypoints.str(), "trajectory.at_rest=false",
         "camera.pose=1.5 0 1.4 -55 0 -92", "camera.first_image=0.2", "camera.count=360",
         "scene.kind=outdoor"});
}

// A car at 11 to 15 m/s: the uncertain scale makes that of the velocity as large as a walker's
// speed, and an uncertain yaw as much again after a while. It starts, and a second without images
// does not lose the motion for long.
TEST(Recovery, StartsAtSpeedAndSurvivesASecondWithoutImages) {
    const Simulation simulation(fast_drive());
    auto frames = simulation.tracks().frames;
    const TimeNs dark = frames.front().t + from_seconds(14);
    const auto inside = [&](TimeNs t) { return t >= dark && t < dark + from_seconds(1); };
    for (FeatureFrame& frame : frames) {
        if (inside(frame.t)) frame.features.clear();
        if (frame.t < dark) continue;
        for (FeatureObservation& f : frame.features) f.feature_id += 1'000'000;
    }
    Iekf filter(simulation.rig(), {}, {});
    test::feed(filter, simulation.imu(), frames);
    filter.finish();
    std::string said;
    for (const StatusEntry& entry : filter.status())
        said += std::to_string(to_seconds(entry.t - frames.front().t)) + " s: " + entry.text + "\n";
    SCOPED_TRACE(said);
    const auto& states = filter.estimate().states;
    ASSERT_EQ(states.size(), frames.size());
    const Similarity S = align_yaw_position(simulation.truth()[0].T_W_B, states[0].T_W_B);
    for (std::size_t i = 0; i < states.size(); ++i) {
        const StateEstimate& state = states[i];
        const bool after = state.t > dark + from_seconds(1.5);
        EXPECT_FALSE(state.lost && (state.t < dark || after)) << i;
        const Vector3d e = (S * simulation.truth()[i].T_W_B).p - state.T_W_B.p;
        const Eigen::Matrix3d P = state.covariance.block<3, 3>(kPosition, kPosition);
        if (i == 0) continue;  // there the world begins
        EXPECT_LT(e.dot(P.ldlt().solve(e)), 16 + 3) << i;
    }
}

// A crane that hardly swings passes for one at rest where it turns back. From there points come to
// be placed by a scale that is wrong many times over; readings contradict it, and it is given up.
TEST(Recovery, AScaleThatReadingsContradictIsGivenUp) {
    ScenarioOptions crane = ScenarioOptions::from_file(
        kDatasets + "crane.ini", {"trajectory.shake_angle=0.05", "trajectory.shake_distance=0.0003",
                                  "camera.count=420", "scenario.seed=36"});
    crane.tracks = true;
    const Simulation simulation(crane);
    BatchOptions batch;
    IekfOptions options;
    options.sigma_px = batch.sigma_px = crane.track_model.noise_px;
    batch.gravity_norm = crane.gravity;
    Iekf filter(simulation.rig(), options, batch);
    test::feed(filter, simulation);
    filter.finish();
    std::string said;
    for (const StatusEntry& entry : filter.status())
        said += std::to_string(simulation.seconds(entry.t)) + " s: " + entry.text + "\n";
    SCOPED_TRACE(said);
    EXPECT_NE(said.find("scale was to be corrected"), std::string::npos);
    const auto& states = filter.estimate().states;
    ASSERT_EQ(states.size(), simulation.truth().size());
    const Similarity S = align_yaw_position(simulation.truth()[0].T_W_B, states[0].T_W_B);
    int outside = 0, known = 0;
    for (std::size_t i = 1; i < states.size(); ++i) {
        const Vector3d e = (S * simulation.truth()[i].T_W_B).p - states[i].T_W_B.p;
        const Eigen::Matrix3d P = states[i].covariance.block<3, 3>(kPosition, kPosition);
        known += !states[i].lost;
        outside += !states[i].lost && e.dot(P.ldlt().solve(e)) > 16 + 3;
    }
    EXPECT_EQ(outside, 0);
    EXPECT_GT(known, 0);
}

// Neither camera nor IMU comes back: what had come until then is made use of at once, and nothing
// that comes after is kept for a start.
TEST(Recovery, StartsFromWhatThereIsWhenImagesOrReadingsEnd) {
    for (const auto kind : {Fault::kNoImages, Fault::kNoReadings}) {
        const FaultOutcome outcome = with_fault({2, 1e3, kind, /*starts_itself=*/true}, 2);
        SCOPED_TRACE("kind " + std::to_string(kind) + "\n" + outcome.said);
        EXPECT_TRUE(outcome.at_last_message);
        EXPECT_GE(outcome.states, outcome.images);
        EXPECT_LT(outcome.worst, 16 + 3);
    }
}

// No start is made of images before and after an interruption.
TEST(Recovery, AStartDoesNotSpanMissingImages) {
    const FaultOutcome outcome = with_fault({0.5, 5, Fault::kNoImages, /*starts_itself=*/true}, 2);
    SCOPED_TRACE(outcome.said);
    EXPECT_LT(outcome.worst, 16 + 3);
    EXPECT_EQ(outcome.lost_at_end, 0);
    EXPECT_EQ(outcome.states, outcome.images + 1 - 10);  // without the ten before them
}

TEST(RestUpdate, MakesTheVelocityKnownButNotPositionAndYaw) {
    CoreState core;
    core.T_W_I = {so3::exp({0.3, -0.2, 1}), {1, 2, 3}};
    core.v_W = {0.002, -0.001, 0.0015};
    core.g_W = {0, 0, -9.81};
    CoreMatrix P = CoreMatrix::Identity(15, 15) * 1e-2;
    FilterState state(CoreKind::inertial, core, P, true);
    state.clone(1);
    state.clone(2);
    ASSERT_TRUE(update_at_rest(state, state.find_clone(1), 0.999, 0, 0.05));
    const CoreMatrix after = state.core_covariance();
    EXPECT_LT(state.core().v_W.norm(), 1e-3);
    EXPECT_LT(after.diagonal().segment<3>(kVelocity).maxCoeff(), 3e-5);
    EXPECT_NEAR(after(kPosition, kPosition), 1e-2, 1e-6);
    const Vector3d up = state.core().T_W_I.R.transpose() * Vector3d::UnitZ();
    EXPECT_NEAR(up.dot(after.topLeftCorner<3, 3>() * up), 1e-2, 1e-6);
    // Motion that the state is sure of is not taken for rest.
    core.v_W = {1, 0, 0};
    FilterState moving(CoreKind::inertial, core, P, true);
    moving.clone(1);
    moving.clone(2);
    EXPECT_FALSE(update_at_rest(moving, moving.find_clone(1), 0.999, 0, 0.05));
    // Where images hide slow motion, it stays possible.
    constexpr double kHidden = 0.04, kInterval = 0.2;
    core.v_W = {0.03, 0, 0};
    FilterState slow(CoreKind::inertial, core, P, true);
    slow.clone(1);
    slow.clone(2);
    ASSERT_TRUE(update_at_rest(slow, slow.find_clone(1), 0.999, kHidden, kInterval));
    EXPECT_GT(slow.core_covariance().diagonal().segment<3>(kVelocity).minCoeff(),
              0.5 * kHidden * kHidden);
}

}  // namespace
}  // namespace vio
