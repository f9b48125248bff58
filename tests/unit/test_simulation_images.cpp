#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <map>

#include "libvio/io/recording.h"
#include "libvio/simulation/export.h"
#include "tests/optical_flow.h"

namespace vio {
namespace {

const std::string kDatasets = std::string(VIO_SOURCE_DIR) + "/datasets/";

bool same_bytes(const cv::Mat& a, const cv::Mat& b) {
    return a.size() == b.size() && a.type() == b.type() &&
           std::equal(a.begin<std::uint8_t>(), a.end<std::uint8_t>(), b.begin<std::uint8_t>());
}

using test::flow_errors;

// The camera turns by up to 3 degrees from image to image, which Lucas-Kanade's pure translation
// feels in proportion to the window; hence a small one.
TEST(Renderer, OpticalFlowAgreesWithTrueProjectionsInTheDemonstration) {
    const Simulation simulation(ScenarioOptions::from_file(kDatasets + "demo.ini"));
    std::vector<double> errors;
    for (int i = 5; i < 151; i += 20)
        for (const double error : flow_errors(simulation, i, 9)) errors.push_back(error);
    ASSERT_GT(errors.size(), 600u);
    RecordProperty("median_px", std::to_string(median(errors)));
    EXPECT_LT(median(errors), 0.15);
}

// With four times the images the tracker's own error nearly goes: what is left bounds the
// renderer's, image by image.
TEST(Renderer, OpticalFlowBetweenCloseImagesAgreesFiner) {
    ScenarioOptions options = ScenarioOptions::from_file(kDatasets + "demo.ini");
    options.image_rate *= 4;
    options.image_count *= 4;
    const Simulation simulation(options);
    for (const int i : {40, 120, 280, 360, 520}) {
        const std::vector<double> errors = flow_errors(simulation, i, 15);
        ASSERT_GT(errors.size(), 60u);
        EXPECT_LT(median(errors), 0.1) << "image " << i;
    }
}

// Every camera model, with blur, noise, vignetting: corners move as the model says.
class RendererOfCamera : public ::testing::TestWithParam<test::FlowCase> {};

TEST_P(RendererOfCamera, OpticalFlowAgreesWithTrueProjections) {
    const Simulation simulation(GetParam().options);
    std::vector<double> errors;
    for (const int i : {5, 45})
        for (const double error : flow_errors(simulation, i, 11)) errors.push_back(error);
    ASSERT_GT(errors.size(), 200u);
    EXPECT_LT(median(errors), 0.15);
}

INSTANTIATE_TEST_SUITE_P(Models, RendererOfCamera, ::testing::ValuesIn(test::flow_cases()),
                         [](const auto& test_case) {
                             std::string name = test_case.param.name;
                             std::erase_if(name, [](char c) { return c == ' ' || c == ','; });
                             return name;
                         });

ScenarioOptions small_scenario() {
    ScenarioOptions options;
    options.image_width = 160;
    options.image_height = 61;
    options.intrinsics = "208 105 79 30";
    options.image_count = 3;
    options.rendering.exposure = 0.005;
    options.rendering.read_noise = 2;
    options.rendering.shot_noise = 2;
    options.tracks = true;
    options.track_model.spacing_px = 4;
    return options;
}

TEST(Renderer, BytesDependOnTheSeedAndNotOnTheThreads) {
    ScenarioOptions options = small_scenario();
    options.rendering.threads = 1;
    const Simulation one(options);
    options.rendering.threads = 5;
    const Simulation five(options);
    options.seed = 2;
    const Simulation other(options);
    for (const int i : {0, 2}) {
        EXPECT_TRUE(same_bytes(one.image(i), five.image(i)));
        EXPECT_FALSE(same_bytes(one.image(i), other.image(i)));
    }
}

TEST(Renderer, NoiseHasTheStatedVarianceAndIsWhite) {
    ScenarioOptions options = small_scenario();
    options.rendering.read_noise = 4;
    options.rendering.shot_noise = 0;
    const Simulation noisy(options);
    options.rendering.read_noise = 0;
    const Simulation clean(options);
    const cv::Mat a = noisy.image(0), b = clean.image(0);
    double sum2 = 0, neighbours = 0;
    int n = 0;
    for (int r = 0; r < a.rows; ++r)
        for (int c = 0; c + 1 < a.cols; ++c) {
            const int x = b.at<std::uint8_t>(r, c), y = b.at<std::uint8_t>(r, c + 1);
            if (std::min(x, y) < 20 || std::max(x, y) > 235) continue;  // could be cut off
            const double d = a.at<std::uint8_t>(r, c) - x, e = a.at<std::uint8_t>(r, c + 1) - y;
            sum2 += d * d;
            neighbours += d * e;
            ++n;
        }
    const double variance = 16 + 1.0 / 6;  // both images are rounded
    ASSERT_GT(n, 4000);
    EXPECT_NEAR(sum2 / n / variance, 1, 4 * std::sqrt(2.0 / n));
    EXPECT_NEAR(neighbours / n / variance, 0, 4 * std::sqrt(1.0 / n));
}

TEST(Tracks, ObservationsAreTrueProjectionsPlusWhiteNoise) {
    ScenarioOptions options = ScenarioOptions::from_file(kDatasets + "perspective_arm.ini");
    options.track_model.most = 60;
    options.track_model.fewest = 50;
    options.track_model.spacing_px = 20;
    const Simulation simulation(options);
    double chi2 = 0;
    int n = 0;
    for (size_t i = 0; i < simulation.truth().size(); ++i) {
        const Pose T_C_W = (simulation.truth()[i].T_W_B * simulation.rig().T_B_C).inverse();
        for (const FeatureObservation& o : simulation.tracks().frames[i].features) {
            const auto uv = simulation.rig().camera->project(
                T_C_W * simulation.tracks().points_W.at(o.feature_id));
            ASSERT_TRUE(uv);
            chi2 += (o.uv_px - *uv).squaredNorm() / 4;
            n += 2;
        }
    }
    ASSERT_GT(n, 10000);
    EXPECT_NEAR(chi2, n, 4 * std::sqrt(2.0 * n));
}

TEST(Tracks, HiddenPointsAreNotSeen) {
    const Simulation simulation(small_scenario());
    const Scene& scene = simulation.scene();
    for (size_t i = 0; i < simulation.truth().size(); ++i) {
        const Pose T_W_C = simulation.truth()[i].T_W_B * simulation.rig().T_B_C;
        for (const FeatureObservation& o : simulation.tracks().frames[i].features) {
            const Eigen::Vector3d p = simulation.tracks().points_W.at(o.feature_id);
            const double distance = (p - T_W_C.p).norm();
            const auto hit = scene.cast(T_W_C.p, (p - T_W_C.p) / distance);
            ASSERT_TRUE(hit);
            EXPECT_NEAR(hit->distance, distance, 1e-3 + 2e-3 * distance);
        }
    }
}

TEST(Tracks, MistracksComeAtTheStatedRateAndTracksEndWhenTold) {
    ScenarioOptions options = ScenarioOptions::from_file(kDatasets + "perspective_arm.ini");
    options.track_model.most = 60;
    options.track_model.fewest = 50;
    options.track_model.spacing_px = 20;
    options.track_model.mistrack_rate = 0.02;
    options.track_model.longest = 12;
    const Simulation simulation(options);
    std::map<FeatureId, int> length;
    int observations = 0;
    for (const FeatureFrame& frame : simulation.tracks().frames)
        for (const FeatureObservation& o : frame.features) ++length[o.feature_id], ++observations;
    for (const auto& [id, images] : length) EXPECT_LE(images, 12) << id;
    const double chances = observations - static_cast<double>(length.size());
    const double jumps = static_cast<double>(simulation.tracks().mistracked.size());
    // A jump out of the image or off the surface is not made: the rate is a little lower.
    EXPECT_LT(jumps, 0.02 * chances + 4 * std::sqrt(0.02 * chances));
    EXPECT_GT(jumps, 0.8 * 0.02 * chances - 4 * std::sqrt(0.02 * chances));
}

TEST(Scenario, PerspectiveArmHasThePapersStatistics) {
    const Simulation simulation(ScenarioOptions::from_file(kDatasets + "perspective_arm.ini"));
    EXPECT_EQ(simulation.image_times().size(), 152u);
    EXPECT_NEAR(static_cast<double>(simulation.imu().size()), 860, 0.05 * 860);
    EXPECT_NEAR(simulation.trajectory().path_length(), 3, 0.05 * 3);
    double observations = 0;
    for (const FeatureFrame& frame : simulation.tracks().frames)
        observations += static_cast<double>(frame.features.size());
    EXPECT_GE(observations / 152, 5);
    EXPECT_LE(observations / 152, 6);
}

TEST(Scenario, RefusesNonsense) {
    ScenarioOptions options = small_scenario();
    options.motion.waypoints = "0 0 0 1 0 0, 1 0 0 1 0 0 0";
    EXPECT_THROW(Simulation{options}, InputError);
    options = small_scenario();
    options.first_image_s = 5;
    options.image_count = 0;
    EXPECT_THROW(Simulation{options}, InputError);
    options = small_scenario();
    options.recorded_file = "/nonexistent.tum";
    EXPECT_THROW(Simulation{options}, InputError);
}

TEST(DemoRawlog, IsWhatItsScenarioMakes) {
    const Simulation simulation(ScenarioOptions::from_file(kDatasets + "demo.ini"));
    Recording recording(kDatasets + "demo.rawlog");
    size_t readings = 0;
    int images = 0;
    while (const auto message = recording.next()) {
        if (const auto* imu = std::get_if<ImuReading>(&*message)) {
            const ImuReading& truth = simulation.imu().at(readings++);
            EXPECT_EQ(imu->t, truth.t);
            EXPECT_EQ(imu->gyro, truth.gyro);
            EXPECT_EQ(imu->accel, truth.accel);
        } else if (const auto* image = std::get_if<ImageMessage>(&*message)) {
            EXPECT_EQ(image->t, simulation.image_times().at(images));
            if (images % 40 == 0) {
                EXPECT_TRUE(same_bytes(image->image, simulation.image(images)));
            }
            ++images;
        }
    }
    EXPECT_EQ(readings, simulation.imu().size());
    EXPECT_EQ(images, 152);
}

}  // namespace
}  // namespace vio
