// Where the motion cannot be known, or most is noise, the recursive estimator says so: errors stay
// inside the stated covariance, or the states are marked lost.
#include <gtest/gtest.h>

#include "libvio/geometry/alignment.h"
#include "libvio/recursive/iekf.h"
#include "libvio/recursive/start_of_attitude.h"
#include "libvio/simulation/scenario.h"
#include "tests/feed.h"

namespace vio {
namespace {

const std::string kStress = std::string(VIO_SOURCE_DIR) + "/datasets/stress/";

Simulation stress(const std::string& file, const std::vector<std::string>& assignments) {
    ScenarioOptions options = ScenarioOptions::from_file(kStress + file, assignments);
    options.tracks = true;
    return Simulation(options);
}

std::optional<GyroBias> bias_of(const Simulation& simulation, int images) {
    const auto& frames = simulation.tracks().frames;
    return gyro_bias_of_rotation({frames.begin(), frames.begin() + images},
                                 ImuSequence(simulation.imu()), simulation.rig(),
                                 simulation.options().track_model.noise_px);
}

// Three degrees of freedom, 30 seeds: four standard deviations of the mean, sqrt(2 / 90). Where the
// camera moves the images cannot be explained so.
TEST(GyroBiasOfRotation, ErrorsMatchTheirCovarianceAndParallaxIsTold) {
    constexpr int kSeeds = 30;
    double nees = 0;
    for (int seed = 0; seed < kSeeds; ++seed) {
        const Simulation simulation = stress(
            "pure_rotation.ini", {"scenario.seed=" + std::to_string(seed), "camera.count=60"});
        const auto bias = bias_of(simulation, 60);
        ASSERT_TRUE(bias) << "seed " << seed;
        const Eigen::Vector3d e = simulation.truth()[30].gyro_bias - bias->mean;
        nees += e.dot(bias->covariance.ldlt().solve(e)) / 3;
    }
    EXPECT_NEAR(nees / kSeeds, 1, 4 * std::sqrt(2.0 / 3 / kSeeds));
    EXPECT_FALSE(bias_of(stress("base.ini", {"camera.count=60"}), 60));
}

struct Outcome {
    int images = 0, states = 0, lost = 0;
    double position2 = 0, rotation2 = 0;  // worst squared Mahalanobis distances; position: not lost
    std::string said;
};

Outcome outcome_of(const Simulation& simulation) {
    BatchOptions batch;
    batch.threads = 1;
    Iekf filter(simulation.stated_rig(), {}, batch);
    test::feed(filter, simulation);
    filter.finish();
    Outcome outcome;
    outcome.images = static_cast<int>(simulation.truth().size());
    const auto& states = filter.estimate().states;
    for (const StatusEntry& entry : filter.status()) outcome.said += entry.text + "\n";
    if (states.empty()) return outcome;
    std::size_t i = 0;
    while (simulation.truth()[i].t != states.front().t) ++i;
    const Similarity S = align_yaw_position(simulation.truth()[i].T_W_B, states.front().T_W_B);
    for (const StateEstimate& state : states) {
        while (simulation.truth()[i].t < state.t) ++i;
        const Vector6d e = (S * simulation.truth()[i].T_W_B).boxminus(state.T_W_B);
        const auto distance2 = [&](int at) {
            const Eigen::Matrix3d P = state.covariance.block<3, 3>(at, at);
            const Eigen::Vector3d d = e.segment<3>(at);
            return P.diagonal().minCoeff() < 1e-10 ? 0 : d.dot(P.ldlt().solve(d));
        };
        ++outcome.states;
        outcome.lost += state.lost;
        outcome.rotation2 = std::max(outcome.rotation2, distance2(kRotation));
        if (!state.lost) outcome.position2 = std::max(outcome.position2, distance2(kPosition));
    }
    return outcome;
}

constexpr double kFourSigma = 16 + 3;  // of three components

// Of all tracks 30 % are wrong. That leaves much unexplained, but is no reason not to start.
TEST(Honesty, MistracksDoNotKeepItFromStarting) {
    const Outcome outcome = outcome_of(stress("mistracks.ini", {"camera.count=120"}));
    SCOPED_TRACE(outcome.said);
    EXPECT_EQ(outcome.states, outcome.images);
    EXPECT_EQ(outcome.lost, 0);
}

// A track that jumped shows two places; a point between them, or one just before the lens, comes
// within five standard deviations of either. The batch estimate that the filter starts from was off
// by 11 to 23 standard deviations on the first three of these while such points were left in it. So
// it was, by 5, while sights that fit such a point by chance, long after the track has left it,
// counted (the last).
TEST(Honesty, TracksOfTwoPlacesDoNotBendTheStart) {
    for (const std::string seed : {"10", "14", "17", "15"}) {
        const Outcome outcome =
            outcome_of(stress("mistracks.ini", {"camera.count=120", "scenario.seed=" + seed}));
        SCOPED_TRACE("seed " + seed + "\n" + outcome.said);
        EXPECT_EQ(outcome.states, outcome.images);
        EXPECT_LT(outcome.position2, kFourSigma);
        EXPECT_LT(outcome.rotation2, kFourSigma);
    }
}

// The stated calibration is off by several of the standard deviations that it is taken to have; the
// readings and images tell.
TEST(Honesty, WrongMountOfTheCameraIsFound) {
    for (const auto& [file, assignments] :
         {std::pair<std::string, std::vector<std::string>>{"time_offset.ini", {}},
          {"extrinsics.ini",
           {"calibration.imu_rotation_sigma=0", "calibration.imu_position_sigma=0",
            "calibration.camera_position_sigma=0.005"}}}) {
        const Outcome outcome = outcome_of(stress(file, assignments));
        SCOPED_TRACE(file + "\n" + outcome.said);
        EXPECT_EQ(outcome.states, outcome.images);
        EXPECT_EQ(outcome.lost, 0);
        EXPECT_LT(outcome.position2, kFourSigma);
        EXPECT_LT(outcome.rotation2, kFourSigma);
    }
}

// Neither path nor scale are to be had: attitude alone, for every image.
TEST(Honesty, AttitudeAloneWhereNothingTellsThePath) {
    for (const std::string file : {"straight.ini", "pure_rotation.ini"}) {
        const Outcome outcome = outcome_of(stress(file, {"camera.count=135"}));
        SCOPED_TRACE(file + "\n" + outcome.said);
        EXPECT_EQ(outcome.states, outcome.images);
        EXPECT_EQ(outcome.lost, outcome.images);
        EXPECT_LT(outcome.rotation2, kFourSigma);
    }
}

// With 30 % of the observations wrong the motion is still known, and no less certain than it seems.
TEST(Honesty, OutliersAreToldFromAWrongPrediction) {
    const Outcome outcome = outcome_of(stress("outliers.ini", {}));
    SCOPED_TRACE(outcome.said);
    EXPECT_EQ(outcome.states, outcome.images);
    EXPECT_EQ(outcome.lost, 0);
    EXPECT_LT(outcome.position2, kFourSigma);
    EXPECT_LT(outcome.rotation2, kFourSigma);
}

}  // namespace
}  // namespace vio
