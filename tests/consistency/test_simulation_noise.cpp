// The simulated tracks and readings have the errors that they claim: the ground on which NEES
// stands.
#include <gtest/gtest.h>

#include "libvio/base/chi_square.h"
#include "libvio/imu/preintegration.h"
#include "libvio/simulation/scenario.h"

namespace vio {
namespace {

/// Residuals of the observations against the true points and poses, by feature in order of time.
std::map<FeatureId, std::vector<Eigen::Vector2d>> residuals(const Simulation& simulation) {
    std::map<FeatureId, std::vector<Eigen::Vector2d>> all;
    for (size_t i = 0; i < simulation.truth().size(); ++i) {
        const Pose T_C_W = (simulation.truth()[i].T_W_B * simulation.rig().T_B_C).inverse();
        for (const FeatureObservation& o : simulation.tracks().frames[i].features)
            all[o.feature_id].push_back(o.uv_px -
                                        *simulation.rig().camera->project(
                                            T_C_W * simulation.tracks().points_W.at(o.feature_id)));
    }
    return all;
}

ScenarioOptions few_images(int seed) {
    ScenarioOptions options =
        ScenarioOptions::from_file(std::string(VIO_SOURCE_DIR) + "/datasets/perspective_arm.ini");
    options.seed = seed;
    options.image_count = 12;
    options.track_model.most = 30;
    options.track_model.fewest = 25;
    options.track_model.spacing_px = 20;
    return options;
}

// Whether a chi-square variable lies in the middle 99 % of its distribution.
bool inside_bounds(double chi2, int degrees) {
    return chi2 >= chi_square_quantile(degrees, 0.005) &&
           chi2 <= chi_square_quantile(degrees, 0.995);
}

TEST(TrackNoise, IsWhiteWithTheStatedCovarianceOver200Seeds) {
    constexpr int kSeeds = 200;
    double squares = 0, count = 0, successive = 0, pairs = 0, across = 0;
    Eigen::Vector2d axis = Eigen::Vector2d::Zero();
    int outside = 0;
    for (int seed = 1; seed <= kSeeds; ++seed) {
        const Simulation simulation(few_images(seed));
        const double sigma = simulation.options().track_model.noise_px;
        double sum = 0, n = 0;
        for (const auto& [id, errors] : residuals(simulation)) {
            for (size_t k = 0; k < errors.size(); ++k) {
                const Eigen::Vector2d e = errors[k] / sigma;
                sum += e.squaredNorm();
                axis += e.cwiseAbs2();
                across += e.x() * e.y();
                n += 1;
                if (k > 0) successive += e.dot(errors[k - 1]) / sigma, pairs += 1;
            }
        }
        outside += inside_bounds(sum, 2 * static_cast<int>(n)) ? 0 : 1;
        squares += sum;
        count += n;
    }
    // Four sigma of each statistic under the claim.
    EXPECT_NEAR(squares, 2 * count, 4 * std::sqrt(4 * count));
    EXPECT_NEAR(axis.x(), count, 4 * std::sqrt(2 * count));
    EXPECT_NEAR(axis.y(), count, 4 * std::sqrt(2 * count));
    EXPECT_NEAR(across, 0, 4 * std::sqrt(count));
    EXPECT_NEAR(successive, 0, 4 * std::sqrt(2 * pairs));
    // One seed in a hundred lies outside its bounds: at most 8 of 200 with probability 0.9998.
    EXPECT_LE(outside, 8);
}

TEST(TrackDrift, WalksWithTheStatedVariance) {
    constexpr int kSeeds = 60;
    double squares = 0, count = 0;
    for (int seed = 1; seed <= kSeeds; ++seed) {
        ScenarioOptions options = few_images(seed);
        options.track_model.noise_px = 0;
        options.track_model.refind = false;
        options.track_model.drift_px = 0.3;
        for (const auto& [id, errors] : residuals(Simulation(options)))
            for (size_t k = 1; k < errors.size(); ++k) {
                squares += (errors[k] - errors[k - 1]).squaredNorm() / (0.3 * 0.3);
                count += 1;
            }
    }
    EXPECT_NEAR(squares, 2 * count, 4 * std::sqrt(4 * count));
}

// What the estimators weigh is the readings integrated from image to image: over seeds, the error
// of that has the covariance that preintegration gives it.
TEST(ImuNoise, IntegratedReadingsHaveTheClaimedCovarianceOver200Seeds) {
    constexpr int kSeeds = 200;
    const Simulation simulation(few_images(1));
    const TimeNs begin = simulation.image_times().front(), end = simulation.image_times().back();
    ImuErrors errors = simulation.options().imu;
    errors.gyro_step = errors.accel_step = 0;  // quantisation is no part of the noise model
    const ImuNoise noise = errors.noise;
    const auto preintegrated = [&](const std::vector<ImuReading>& readings, const ImuBias& bias) {
        return PreintegratedImu(ImuSequence(readings).segments(begin, end).value(), bias, noise);
    };
    const InertialState start;
    const InertialState reached =
        preintegrated(simulation.ideal_imu(), {}).predict(start, {}, simulation.g_W());

    double squares = 0, gyro_walk = 0, accel_walk = 0, steps = 0;
    int outside = 0;
    for (int seed = 1; seed <= kSeeds; ++seed) {
        Random random(static_cast<std::uint64_t>(seed), "imu");
        errors.initial_bias = {0.01 * random.normal3(), 0.2 * random.normal3()};
        const SimulatedImu imu = with_errors(simulation.ideal_imu(), errors, random);
        std::vector<ImuReading> unbiased = imu.readings;
        for (size_t k = 0; k < unbiased.size(); ++k) {
            unbiased[k].gyro -= imu.biases[k].gyro;
            unbiased[k].accel -= imu.biases[k].accel;
            if (k == 0) continue;
            const double dt = to_seconds(unbiased[k].t - unbiased[k - 1].t);
            gyro_walk += (imu.biases[k].gyro - imu.biases[k - 1].gyro).squaredNorm() /
                         (std::pow(noise.gyro_bias_random_walk, 2) * dt);
            accel_walk += (imu.biases[k].accel - imu.biases[k - 1].accel).squaredNorm() /
                          (std::pow(noise.accel_bias_random_walk, 2) * dt);
            steps += 3;
        }
        const PreintegratedImu measured = preintegrated(unbiased, {});
        const Vector9d r = measured.residual(start, reached, {}, simulation.g_W());
        const double chi2 = r.dot(measured.covariance().ldlt().solve(r));
        squares += chi2;
        outside += inside_bounds(chi2, 9) ? 0 : 1;
    }
    EXPECT_NEAR(squares, 9 * kSeeds, 4 * std::sqrt(2 * 9.0 * kSeeds));
    EXPECT_LE(outside, 8);
    EXPECT_NEAR(gyro_walk, steps, 4 * std::sqrt(2 * steps));
    EXPECT_NEAR(accel_walk, steps, 4 * std::sqrt(2 * steps));
}

}  // namespace
}  // namespace vio
