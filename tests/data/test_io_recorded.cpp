// Recorded ASL data sets become rawlogs without loss.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "libvio/camera/perspective.h"
#include "libvio/io/asl_import.h"
#include "libvio/io/recording.h"
#include "libvio/io/text.h"
#include "libvio/io/trajectory_io.h"
#include "tests/data/recorded_data.h"
#include "tests/unit/scratch_folder.h"

namespace vio {
namespace {

namespace fs = std::filesystem;

constexpr TimeNs kTick = 100;

TEST(RecordedData, Mh01KeepsEveryImageAndReading) {
    const fs::path data = test::recorded_data("euroc_mh01_15s");
    VIO_NEED_DATA(data);
    test::ScratchFolder folder;
    const auto report = import_asl(data.string(), folder / "mh01.rawlog");
    EXPECT_EQ(report.images, 300);
    EXPECT_EQ(report.first, 1403636582763555584);

    Recording recording(folder / "mh01.rawlog");
    ASSERT_TRUE(recording.rig().camera);
    TextRows images((data / "mav0/cam0/data.csv").string());
    TextRows readings((data / "mav0/imu0/data.csv").string());
    int imu_count = 0;
    while (auto message = recording.next()) {
        if (const auto* imu = std::get_if<ImuReading>(&*message)) {
            ASSERT_TRUE(readings.next());
            ASSERT_EQ(imu->t, readings.integer(0) / kTick * kTick);
            for (int k = 0; k < 3; ++k) {
                ASSERT_EQ(imu->gyro(k), readings.number(static_cast<size_t>(1 + k)));
                ASSERT_EQ(imu->accel(k), readings.number(static_cast<size_t>(4 + k)));
            }
            ++imu_count;
        } else {
            ASSERT_TRUE(images.next());
            const auto& image = std::get<ImageMessage>(*message);
            ASSERT_EQ(image.t, images.integer(0) / kTick * kTick);
            const auto png = data / "mav0/cam0/data" / std::string(images.text(1));
            const cv::Mat pixels = cv::imread(png.string(), cv::IMREAD_GRAYSCALE);
            ASSERT_EQ(cv::norm(image.image, pixels, cv::NORM_INF), 0) << png;
        }
    }
    EXPECT_FALSE(images.next());
    EXPECT_FALSE(readings.next());
    EXPECT_EQ(imu_count, report.imu_readings);
    EXPECT_EQ(read_trajectory(report.truth_file).size(), static_cast<size_t>(report.truth_poses));
    EXPECT_GT(report.truth_poses, 3000);
}

TEST(RecordedData, AprilCornersBecomeFeatureFrames) {
    const fs::path data = test::recorded_data("euroc_imu_april");
    VIO_NEED_DATA(data);
    test::ScratchFolder folder;
    const std::string script = std::string(VIO_SOURCE_DIR) + "/tests/make_april_asl.sh '" +
                               data.string() + "' '" + (folder / "asl") + "'";
    ASSERT_EQ(std::system(script.c_str()), 0);
    const auto report = import_asl(folder / "asl", folder / "april.rawlog");
    EXPECT_EQ(report.feature_frames, 1416);
    EXPECT_EQ(report.imu_readings, 14374);

    Recording recording(folder / "april.rawlog");
    EXPECT_TRUE(recording.has_features());
    TextRows rows((data / "cam0_corners.csv.gz").string());
    while (auto message = recording.next()) {
        const auto* frame = std::get_if<FeatureFrame>(&*message);
        if (!frame) continue;
        for (const FeatureObservation& feature : frame->features) {
            ASSERT_TRUE(rows.next());
            ASSERT_EQ(frame->t, rows.integer(0) / kTick * kTick);
            ASSERT_EQ(feature.feature_id, rows.integer(1));
            ASSERT_EQ(feature.uv_px, Eigen::Vector2d(rows.number(2), rows.number(3)));
        }
    }
    EXPECT_FALSE(rows.next());
}

TEST(RecordedData, GroundTruthWithVelocityAndBiasesIsRead) {
    const fs::path data = test::recorded_data("euroc_v101_imu_gt");
    VIO_NEED_DATA(data);
    const auto poses = read_trajectory((data / "groundtruth.csv").string());
    EXPECT_GT(poses.size(), 2800u);
    EXPECT_EQ(poses.front().t, 1403715273262142976);
    EXPECT_EQ(poses.front().T_W_B.p, Eigen::Vector3d(0.878895, 2.1834, 0.948427));
}

}  // namespace
}  // namespace vio
