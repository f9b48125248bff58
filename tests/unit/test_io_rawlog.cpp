// Rawlogs: what is written is read back exactly, and damage is told in one line.
#include <gtest/gtest.h>
#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CActionRobotMovement2D.h>
#include <mrpt/obs/CObservationImage.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/serialization/CArchive.h>

#include <filesystem>
#include <fstream>
#include <limits>
#include <opencv2/core.hpp>
#include <sstream>

#include "libvio/base/errors.h"
#include "libvio/camera/perspective.h"
#include "libvio/io/feature_observation.h"
#include "libvio/io/gz_stream.h"
#include "libvio/io/mrpt_conversions.h"
#include "libvio/io/rawlog_info.h"
#include "libvio/io/rawlog_writer.h"
#include "libvio/io/text.h"
#include "tests/unit/scratch_folder.h"

namespace vio {
namespace {

namespace fs = std::filesystem;
using test::error_of;
using test::ScratchFolder;

constexpr TimeNs kStart = 1403636584763555500;  // a whole number of MRPT's ticks

Rig test_rig() {
    PerspectiveParameters p;
    p.width = 64;
    p.height = 48;
    p.fx = 45.865123456789;
    p.fy = 45.729600000001;
    p.cx = 31.7215;
    p.cy = 24.8375;
    p.distortion = {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0.01, 0.02, 0.03, 0.04};
    Rig rig;
    rig.camera = std::make_shared<PerspectiveCamera>(p);
    rig.T_B_C = {so3::exp({0.3, -1.4, 2.2}), {-0.0216401454975, -0.064676986768, 0.00981073058949}};
    rig.T_B_I = {so3::exp({-2.9, 0.2, 0.4}), {0.1, 1.0 / 3, -0.7}};
    rig.imu_noise = {1.6968e-4, 2e-3, 1.9393e-5, 3e-3};
    rig.time_offset = -0.0123;
    return rig;
}

cv::Mat test_image(int seed) {
    cv::Mat image(48, 64, CV_8UC1);
    cv::RNG rng(static_cast<std::uint64_t>(seed));
    rng.fill(image, cv::RNG::UNIFORM, 0, 256);
    return image;
}

FeatureFrame test_features(TimeNs t, bool shaped) {
    FeatureFrame frame;
    frame.t = t;
    for (int i = 0; i < 5; ++i) {
        FeatureObservation f;
        f.feature_id = (std::int64_t{1} << 40) + 7 * i;
        f.uv_px = {1.0 / 3 + i, 47.0 - std::sqrt(2.0) * i};
        if (shaped) f.covariance_shape << 1.0 + i, 0.1, 0.1, 0.7;
        frame.features.push_back(f);
    }
    return frame;
}

// One measurement of each kind, and again, in order of time.
std::vector<Message> test_messages() {
    std::vector<Message> messages;
    for (int i = 0; i < 3; ++i) {
        const TimeNs t = kStart + 50000000LL * i;
        messages.push_back(ImuReading{t - 300, {0.1 + i, -0.2, 1.0 / 3}, {9.4, -0.3, -3.2 / 7}});
        messages.push_back(ImageMessage{t, test_image(i)});
        messages.push_back(test_features(t, i == 1));
        messages.push_back(
            OdometryMessage{t + 100, {so3::exp({0, 0, 0.3 * i}), {1.5, 0.1 * i, 0}}});
        messages.push_back(GpsMessage{t + 200, 36.715 + i / 7.0, -4.478, 57.25 + i, 4});
    }
    return messages;
}

void write(const std::string& file, const std::vector<Message>& messages, const Rig& rig,
           const RawlogWriterOptions& options = {}) {
    RawlogWriter writer(file, rig, options);
    for (const Message& message : messages) writer.write(message);
    writer.finish();
}

std::vector<Message> read_all(Recording& recording) {
    std::vector<Message> messages;
    while (auto message = recording.next()) messages.push_back(*message);
    return messages;
}

void expect_same(const ImuReading& a, const ImuReading& b) {
    EXPECT_EQ(a.t, b.t);
    EXPECT_EQ(a.gyro, b.gyro);
    EXPECT_EQ(a.accel, b.accel);
}

void expect_same(const ImageMessage& a, const ImageMessage& b) {
    EXPECT_EQ(a.t, b.t);
    ASSERT_EQ(a.image.size(), b.image.size());
    ASSERT_EQ(a.image.type(), b.image.type());
    EXPECT_EQ(cv::norm(a.image, b.image, cv::NORM_INF), 0);
}

void expect_same(const FeatureFrame& a, const FeatureFrame& b) {
    EXPECT_EQ(a.t, b.t);
    ASSERT_EQ(a.features.size(), b.features.size());
    for (std::size_t i = 0; i < a.features.size(); ++i) {
        EXPECT_EQ(a.features[i].feature_id, b.features[i].feature_id);
        EXPECT_EQ(a.features[i].uv_px, b.features[i].uv_px);
        EXPECT_EQ(a.features[i].covariance_shape, b.features[i].covariance_shape);
    }
}

void expect_same(const OdometryMessage& a, const OdometryMessage& b) {
    EXPECT_EQ(a.t, b.t);
    EXPECT_EQ(a.T_O_B.p, b.T_O_B.p);
    EXPECT_LT(a.T_O_B.boxminus(b.T_O_B).norm(), 1e-15);
}

void expect_same(const GpsMessage& a, const GpsMessage& b) {
    EXPECT_EQ(a.t, b.t);
    EXPECT_EQ(a.latitude_deg, b.latitude_deg);
    EXPECT_EQ(a.longitude_deg, b.longitude_deg);
    EXPECT_EQ(a.altitude_m, b.altitude_m);
    EXPECT_EQ(a.fix_quality, b.fix_quality);
}

void expect_same(const std::vector<Message>& a, const std::vector<Message>& b) {
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t i = 0; i < a.size(); ++i) {
        ASSERT_EQ(a[i].index(), b[i].index()) << "message " << i;
        std::visit(
            [&](const auto& message) {
                expect_same(message, std::get<std::decay_t<decltype(message)>>(b[i]));
            },
            a[i]);
    }
}

class RawlogRoundTrip : public ::testing::TestWithParam<bool> {};

TEST_P(RawlogRoundTrip, IsExactToTheTickAndBit) {
    ScratchFolder folder;
    const std::string file = folder / "a.rawlog";
    RawlogWriterOptions options;
    options.external_images = GetParam();
    write(file, test_messages(), test_rig(), options);

    Recording recording(file);
    EXPECT_TRUE(recording.has_imu());
    EXPECT_TRUE(recording.has_images());
    EXPECT_TRUE(recording.has_features());
    expect_same(test_messages(), read_all(recording));
    EXPECT_EQ(recording.progress(), 1);
}

TEST_P(RawlogRoundTrip, CarriesTheCalibration) {
    ScratchFolder folder;
    RawlogWriterOptions options;
    options.external_images = GetParam();
    const Rig wrote = test_rig();
    write(folder / "a.rawlog", test_messages(), wrote, options);

    const Recording recording(folder / "a.rawlog");
    const Rig& rig = recording.rig();
    const auto camera = std::dynamic_pointer_cast<const PerspectiveCamera>(rig.camera);
    ASSERT_TRUE(camera);
    const auto expected =
        std::dynamic_pointer_cast<const PerspectiveCamera>(wrote.camera)->parameters();
    EXPECT_EQ(camera->parameters().width, expected.width);
    EXPECT_EQ(camera->parameters().height, expected.height);
    EXPECT_EQ(camera->parameters().fx, expected.fx);
    EXPECT_EQ(camera->parameters().fy, expected.fy);
    EXPECT_EQ(camera->parameters().cx, expected.cx);
    EXPECT_EQ(camera->parameters().cy, expected.cy);
    EXPECT_EQ(camera->parameters().distortion, expected.distortion);
    EXPECT_LT((rig.T_B_C.R - wrote.T_B_C.R).norm(), 1e-12);
    EXPECT_LT((rig.T_B_I.R - wrote.T_B_I.R).norm(), 1e-12);
    EXPECT_EQ(rig.T_B_C.p, wrote.T_B_C.p);
    EXPECT_EQ(rig.T_B_I.p, wrote.T_B_I.p);
    EXPECT_EQ(rig.imu_noise.gyro_noise_density, wrote.imu_noise.gyro_noise_density);
    EXPECT_EQ(rig.imu_noise.accel_noise_density, wrote.imu_noise.accel_noise_density);
    EXPECT_EQ(rig.imu_noise.gyro_bias_random_walk, wrote.imu_noise.gyro_bias_random_walk);
    EXPECT_EQ(rig.imu_noise.accel_bias_random_walk, wrote.imu_noise.accel_bias_random_walk);
    EXPECT_EQ(rig.time_offset, wrote.time_offset);
}

INSTANTIATE_TEST_SUITE_P(Images, RawlogRoundTrip, ::testing::Values(false, true),
                         [](const auto& images) { return images.param ? "External" : "Embedded"; });

// Rotations near MRPT's gimbal lock (pitch +-90 deg), where angles would lose digits.
TEST(Rawlog, KeepsExtrinsicsAtGimbalLock) {
    ScratchFolder folder;
    Rig rig = test_rig();
    rig.T_B_C.R = so3::exp({0, M_PI / 2 - 1e-9, 0}) * so3::exp({0.4, 0, 0});
    write(folder / "a.rawlog", test_messages(), rig);
    EXPECT_LT((Recording(folder / "a.rawlog").rig().T_B_C.R - rig.T_B_C.R).norm(), 1e-12);
}

TEST(Rawlog, SameInputGivesSameBytes) {
    ScratchFolder folder;
    write(folder / "a.rawlog", test_messages(), test_rig());
    write(folder / "b.rawlog", test_messages(), test_rig());
    const std::string a = read_text(folder / "a.rawlog");
    EXPECT_GT(a.size(), 1000u);
    EXPECT_TRUE(a == read_text(folder / "b.rawlog"));
}

TEST(Rawlog, UnfinishedWriterLeavesNothing) {
    ScratchFolder folder;
    {
        RawlogWriter writer(folder / "a.rawlog", test_rig());
        writer.write(test_messages().front());
    }
    EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(Rawlog, UncalibratedImagesHaveNoCamera) {
    ScratchFolder folder;
    write(folder / "a.rawlog", test_messages(), Rig{});
    const Recording recording(folder / "a.rawlog");
    EXPECT_FALSE(recording.rig().camera);
    EXPECT_TRUE(recording.has_images());
}

TEST(Rawlog, CalibrationFileOverridesKeyByKey) {
    ScratchFolder folder;
    write(folder / "a.rawlog", test_messages(), test_rig());
    write_text(folder / "c.ini",
               "[camera]\nfx = 50.5\ndistortion = 0.1 0.2 0.3 0.4\nT_B_C = 1 2 3 0 0 0 1\n"
               "[imu]\naccel_noise_density = 0.5\n");
    RecordingOptions options;
    options.calibration_files = {folder / "c.ini"};
    const Recording recording(folder / "a.rawlog", options);
    const Rig& rig = recording.rig();
    const auto& p = std::dynamic_pointer_cast<const PerspectiveCamera>(rig.camera)->parameters();
    EXPECT_EQ(p.fx, 50.5);
    EXPECT_EQ(p.fy, 45.729600000001);
    EXPECT_EQ(p.distortion, (std::array<double, 8>{0.1, 0.2, 0.3, 0.4, 0, 0, 0, 0}));
    EXPECT_EQ(rig.T_B_C.p, Eigen::Vector3d(1, 2, 3));
    EXPECT_EQ(rig.imu_noise.accel_noise_density, 0.5);
    EXPECT_EQ(rig.imu_noise.gyro_noise_density, 1.6968e-4);
}

// The example of share/formats.md, comments and all, is a whole calibration.
TEST(Rawlog, DocumentedCalibrationIsTaken) {
    ScratchFolder folder;
    write(folder / "a.rawlog", {ImuReading{kStart, {0, 0, 0}, {0, 0, 9.8}}}, Rig{});
    const std::string page = read_text(std::string(VIO_SOURCE_DIR) + "/share/formats.md");
    const auto begin = page.find("```ini\n") + 7, end = page.find("```", begin);
    write_text(folder / "c.ini", page.substr(begin, end - begin));
    RecordingOptions options;
    options.calibration_files = {folder / "c.ini"};
    const Recording recording(folder / "a.rawlog", options);
    ASSERT_TRUE(recording.rig().camera);
    const auto& p = dynamic_cast<const PerspectiveCamera&>(*recording.rig().camera).parameters();
    EXPECT_EQ(p.width, 752);
    EXPECT_EQ(p.cy, 248.375);
    EXPECT_EQ(p.distortion[3], 1.8e-5);
    EXPECT_EQ(recording.rig().imu_noise.accel_bias_random_walk, 3e-3);
}

TEST(Rawlog, BadCalibrationFilesAreRefused) {
    ScratchFolder folder;
    write(folder / "a.rawlog", test_messages(), Rig{});
    const auto error = [&](const std::string& text) {
        write_text(folder / "c.ini", text);
        RecordingOptions options;
        options.calibration_files = {folder / "c.ini"};
        return error_of([&] { Recording recording(folder / "a.rawlog", options); });
    };
    EXPECT_NE(error("[camera]\nfx = 12abc\n").find("[camera] fx: '12abc'"), std::string::npos);
    EXPECT_NE(error("[camera]\nfoo = 1\n").find("foo: no such key"), std::string::npos);
    EXPECT_NE(error("[cam]\nfx = 1\n").find("[cam]: no such section"), std::string::npos);
    EXPECT_NE(error("[camera]\nfx = 100\n").find("width is missing"), std::string::npos);
    EXPECT_NE(error("[camera]\nT_B_C = 0 0 0 0 0 0 2\n").find("unit length"), std::string::npos);
}

TEST(Rawlog, LabelsChooseTheSensors) {
    ScratchFolder folder;
    GzOutput out(folder / "a.rawlog");
    auto archive = mrpt::serialization::archiveFrom(out);
    for (int i = 0; i < 4; ++i)
        for (const char* label : {"left", "right"}) {
            auto imu = to_mrpt(ImuReading{kStart + i * 1000, {1, 2, 3}, {4, 5, 6.0 + label[0]}});
            imu.sensorLabel = label;
            archive << imu;
        }
    out.close();
    RecordingOptions options;
    options.imu_label = "right";
    Recording recording(folder / "a.rawlog", options);
    const auto messages = read_all(recording);
    ASSERT_EQ(messages.size(), 4u);
    EXPECT_EQ(std::get<ImuReading>(messages[0]).accel.z(), 6.0 + 'r');

    options.imu_label = "top";
    const auto error = error_of([&] { Recording r(folder / "a.rawlog", options); });
    EXPECT_NE(error.find("'left' 'right'"), std::string::npos) << error;
}

// However often it is seen, and though the camera asked for is there no more than the IMU.
TEST(Rawlog, LabelsAreListedOnce) {
    ScratchFolder folder;
    GzOutput out(folder / "a.rawlog");
    auto archive = mrpt::serialization::archiveFrom(out);
    for (int i = 0; i < 30; ++i) {
        auto reading = to_mrpt(ImuReading{kStart + 100 * i, {1, 2, 3}, {4, 5, 6}});
        reading.sensorLabel = "imu0";
        auto frame = to_mrpt(FeatureFrame{kStart + 100 * i, {}});
        frame.sensorLabel = i % 2 == 0 ? "left" : "right";
        archive << reading << frame;
    }
    out.close();
    RecordingOptions options;
    options.camera_label = "foo";
    std::string error = error_of([&] { Recording r(folder / "a.rawlog", options); });
    EXPECT_EQ(error, (folder / "a.rawlog") +
                         ": no camera labelled 'foo'; labels in the file: 'left' 'right'");
    options = {};
    options.imu_label = "bar";
    error = error_of([&] { Recording r(folder / "a.rawlog", options); });
    EXPECT_EQ(error, (folder / "a.rawlog") + ": no IMU labelled 'bar'; labels in the file: 'imu0'");
}

TEST(Rawlog, ReadsActionsAndSensoryFrames) {
    ScratchFolder folder;
    GzOutput out(folder / "a.rawlog");
    auto archive = mrpt::serialization::archiveFrom(out);
    for (int i = 0; i < 2; ++i) {
        mrpt::obs::CActionRobotMovement2D move;
        move.timestamp = to_mrpt(kStart + 100 * i);
        move.rawOdometryIncrementReading = mrpt::poses::CPose2D(1, 0, M_PI / 2);
        mrpt::obs::CActionCollection actions;
        actions.insert(move);
        mrpt::obs::CSensoryFrame frame;
        frame.insert(std::make_shared<mrpt::obs::CObservationIMU>(
            to_mrpt(ImuReading{kStart + 100 * i, {1, 2, 3}, {4, 5, 6}})));
        archive << actions << frame;
    }
    out.close();
    Recording recording(folder / "a.rawlog");
    const auto messages = read_all(recording);
    ASSERT_EQ(messages.size(), 4u);
    // Forward by 1 m and a quarter turn left, twice.
    const Pose& T_O_B = std::get<OdometryMessage>(messages[2]).T_O_B;
    EXPECT_LT((T_O_B.p - Eigen::Vector3d(1, 1, 0)).norm(), 1e-12);
    EXPECT_EQ(std::get<ImuReading>(messages[3]).t, kStart + 100);
}

TEST(Rawlog, ImuFieldsAreMrptsOwn) {
    const auto imu = to_mrpt(ImuReading{kStart, {1, 2, 3}, {4, 5, 6}});
    EXPECT_EQ(imu.rawMeasurements[3], 3);  // z first
    EXPECT_EQ(imu.rawMeasurements[4], 2);
    EXPECT_EQ(imu.rawMeasurements[5], 1);
    EXPECT_EQ(imu.rawMeasurements[0], 4);
    EXPECT_EQ(imu.rawMeasurements[1], 5);
    EXPECT_EQ(imu.rawMeasurements[2], 6);
}

TEST(Rawlog, StampsAreExactToTheTick) {
    for (const TimeNs t : {TimeNs{0}, kStart, TimeNs{-100}, TimeNs{4102444800000000100}})
        EXPECT_EQ(from_mrpt(to_mrpt(t)), t);
    EXPECT_EQ(from_mrpt(to_mrpt(kStart + 99)), kStart);
    EXPECT_EQ(from_mrpt(to_mrpt(-1)), -100);
}

// Whatever the place of the cut, reading yields the objects before it and then says so.
TEST(Rawlog, TruncationIsReportedAfterWhatCanBeRead) {
    ScratchFolder folder;
    write(folder / "a.rawlog", test_messages(), test_rig());
    const std::string whole = read_text(folder / "a.rawlog");
    for (const std::size_t cut : {whole.size() / 2, whole.size() - 9, whole.size() - 1}) {
        write_text(folder / "b.rawlog", whole.substr(0, cut));
        std::size_t messages = 0;
        const std::string error = error_of([&] {
            Recording recording(folder / "b.rawlog");
            while (recording.next()) ++messages;
        });
        EXPECT_NE(error.find("b.rawlog (after object"), std::string::npos) << cut << error;
        EXPECT_NE(error.find("cut off"), std::string::npos) << cut << error;
        EXPECT_GT(messages, 3u) << cut;
    }
}

TEST(Rawlog, CutBetweenUncompressedBytesIsReported) {
    ScratchFolder folder;
    std::string bytes;
    {
        std::ofstream plain(folder / "a.rawlog", std::ios::binary);
        std::vector<std::uint8_t> object;
        const auto imu = to_mrpt(ImuReading{kStart, {1, 2, 3}, {4, 5, 6}});
        mrpt::serialization::ObjectToOctetVector(&imu, object);
        for (int i = 0; i < 3; ++i) bytes.append(object.begin(), object.end());
    }
    const std::size_t object_size = bytes.size() / 3;
    for (std::size_t cut = 2 * object_size + 1; cut < bytes.size(); cut += 7) {
        write_text(folder / "a.rawlog", bytes.substr(0, cut));
        Recording recording(folder / "a.rawlog");
        EXPECT_TRUE(recording.next() && recording.next());
        EXPECT_NE(error_of([&] { recording.next(); }), "") << cut;
    }
}

TEST(Rawlog, UnknownClassIsNamed) {
    ScratchFolder folder;
    std::vector<std::uint8_t> object;
    const auto imu = to_mrpt(ImuReading{kStart, {1, 2, 3}, {4, 5, 6}});
    mrpt::serialization::ObjectToOctetVector(&imu, object);
    std::string bytes(object.begin(), object.end()), unknown = bytes;
    unknown.replace(unknown.find("CObservationIMU"), 15, "CObservationXYZ");
    write_text(folder / "a.rawlog", bytes + unknown);
    Recording recording(folder / "a.rawlog");
    EXPECT_TRUE(recording.next());
    const std::string error = error_of([&] { recording.next(); });
    EXPECT_NE(error.find("CObservationXYZ"), std::string::npos) << error;
    EXPECT_NE(error.find("(after object 1"), std::string::npos) << error;
}

TEST(Rawlog, ForeignFilesAreRefusedInOneLine) {
    ScratchFolder folder;
    write_text(folder / "empty.rawlog", "");
    write_text(folder / "text.rawlog", "this is a shopping list\nmilk\n");
    std::string noise(100000, 0);
    for (std::size_t i = 0; i < noise.size(); ++i) noise[i] = static_cast<char>(i * i * 31 >> 3);
    write_text(folder / "noise.rawlog", noise);
    for (const char* name :
         {"missing.rawlog", "empty.rawlog", "text.rawlog", "noise.rawlog", "."}) {
        const std::string error = error_of([&] { Recording recording(folder / name); });
        EXPECT_NE(error.find(name), std::string::npos) << error;
        EXPECT_EQ(error.find('\n'), std::string::npos) << error;
    }
}

// What users name in place of a rawlog: the line says what it is, and what leads to a rawlog.
TEST(Rawlog, OtherRecordingsAreRefusedWithTheWayOn) {
    using namespace std::string_literals;
    ScratchFolder folder;
    const auto says = [&](const std::string& path) {
        const std::string error = error_of([&] { Recording recording(path); });
        EXPECT_EQ(error.find(path + ": is a"), 0u) << error;
        EXPECT_EQ(error.find('\n'), std::string::npos) << error;
        EXPECT_EQ(error_of([&] { read_rawlog_info(path); }), error);
        return error;
    };
    const auto file = [&](const char* name, const std::string& bytes) {
        fs::create_directories(fs::path(folder / name).parent_path());
        write_text(folder / name, bytes);
        return folder / name;
    };
    EXPECT_NE(says(file("a.bag", "#ROSBAG V2.0\n\x45\0"s)).find("rosbag2rawlog"),
              std::string::npos);
    for (const std::string& bytes : {"SQLite format 3\0\x10\0"s, "\x89MCAP0\r\n\x01"s})
        EXPECT_NE(says(file("a.db3", bytes)).find("ROS 2 bag"), std::string::npos);
    file("bag2/metadata.yaml", "rosbag2_bagfile_information:\n");
    EXPECT_NE(says(folder / "bag2").find("ROS 2 bag"), std::string::npos);
    EXPECT_NE(says(file("a.zip", "PK\x03\x04..")).find("unpack"), std::string::npos);

    const auto import = [&](const char* layout, const char* name) {
        return "vio-slam import "s + layout + " " + (folder / name) + " -o ";
    };
    file("MH_01/mav0/cam0/sensor.yaml", "");
    EXPECT_NE(says(folder / "MH_01").find(import("asl", "MH_01") + "MH_01.rawlog"),
              std::string::npos);
    EXPECT_NE(says(folder / "MH_01/").find(import("asl", "MH_01/") + "MH_01.rawlog"),
              std::string::npos);
    EXPECT_NE(says(folder / "MH_01/mav0").find(import("asl", "MH_01/mav0") + "MH_01.rawlog"),
              std::string::npos);
    file("room/dso/camchain.yaml", "");
    file("room/mav0/cam0/data.csv", "");
    EXPECT_NE(says(folder / "room").find(import("tum-vi", "room")), std::string::npos);
    file("drive/oxts/timestamps.txt", "");
    file("drive/image_00/timestamps.txt", "");
    EXPECT_NE(says(folder / "drive").find(import("kitti", "drive")), std::string::npos);
    fs::create_directory(folder / "other");
    EXPECT_NE(says(folder / "other").find("vio-slam import --help"), std::string::npos);
}

// One image that is gone costs that image; their whole folder, the recording.
TEST(Rawlog, MissingExternalImageIsLeftOutAndTold) {
    ScratchFolder folder;
    RawlogWriterOptions options;
    options.external_images = true;
    write(folder / "a.rawlog", test_messages(), test_rig(), options);
    const std::string name = "cam0_" + std::to_string(kStart) + ".png";
    ASSERT_TRUE(fs::remove(fs::path(folder / "a_Images") / name));
    Recording recording(folder / "a.rawlog");
    EXPECT_EQ(read_all(recording).size(), test_messages().size() - 1);
    ASSERT_EQ(recording.left_out().kinds().size(), 1u);
    const LeftOut& images = recording.left_out().kinds()[0];
    EXPECT_EQ(images.what, "images");
    EXPECT_EQ(images.count, 1);
    EXPECT_NE(images.first.find(name + " is missing"), std::string::npos) << images.first;

    fs::remove_all(folder / "a_Images");
    const std::string error = error_of([&] {
        Recording again(folder / "a.rawlog");
        read_all(again);
    });
    EXPECT_NE(error.find("keep that folder beside the rawlog"), std::string::npos) << error;
}

// A reading that is not finite, an observation without stamp: left out, and what follows is read.
TEST(Rawlog, UnusableObservationsAreLeftOutAndTold) {
    ScratchFolder folder;
    GzOutput out(folder / "a.rawlog");
    auto archive = mrpt::serialization::archiveFrom(out);
    const auto put = [&](int i, double gyro_x) {
        archive << to_mrpt(ImuReading{kStart + 100 * i, {gyro_x, 2, 3}, {4, 5, 6}});
    };
    put(0, 1);
    put(1, std::numeric_limits<double>::quiet_NaN());
    put(2, std::numeric_limits<double>::infinity());
    auto unstamped = to_mrpt(ImuReading{kStart, {1, 2, 3}, {4, 5, 6}});
    unstamped.timestamp = INVALID_TIMESTAMP;
    archive << unstamped;
    put(4, 1);
    out.close();
    Recording recording(folder / "a.rawlog");
    const auto messages = read_all(recording);
    ASSERT_EQ(messages.size(), 2u);
    EXPECT_EQ(std::get<ImuReading>(messages[1]).t, kStart + 400);
    ASSERT_EQ(recording.left_out().kinds().size(), 1u);
    EXPECT_EQ(one_line(recording.left_out().kinds()[0])
                  .find("3 IMU readings; the first: " + (folder / "a.rawlog") + " (object 2): "),
              0u)
        << one_line(recording.left_out().kinds()[0]);
}

TEST(Rawlog, ImageOfAnotherSizeThanCalibratedIsRefused) {
    ScratchFolder folder;
    write(folder / "a.rawlog", {ImageMessage{kStart, cv::Mat(24, 32, CV_8UC1, cv::Scalar(7))}},
          test_rig());
    Recording recording(folder / "a.rawlog");
    EXPECT_NE(error_of([&] { recording.next(); }).find("32x24"), std::string::npos);
}

// In the file's own words, not in the lines of an exception of MRPT's.
TEST(Rawlog, WriterTellsOfAFullDiskInOneLine) {
    ScratchFolder folder;
    fs::create_symlink("/dev/full", folder / "a.rawlog.partial");
    cv::Mat noise(1000, 1000, CV_8UC1);
    cv::RNG(1).fill(noise, cv::RNG::UNIFORM, 0, 256);
    const std::string error = error_of([&] {
        RawlogWriter writer(folder / "a.rawlog", {});
        writer.write(ImageMessage{kStart, noise});
    });
    EXPECT_EQ(error, (folder / "a.rawlog.partial") + ": cannot be written; is the disk full?");
    EXPECT_FALSE(fs::exists(folder / "a.rawlog"));
}

TEST(Rawlog, WriterRefusesWhatItCannotKeep) {
    ScratchFolder folder;
    RawlogWriter writer(folder / "a.rawlog", test_rig());
    EXPECT_NE(error_of([&] {
                  writer.write(OdometryMessage{kStart, {so3::exp({0.1, 0, 0}), {0, 0, 0}}});
              }),
              "");
    EXPECT_NE(error_of([&] { writer.write(ImageMessage{kStart, cv::Mat(4, 4, CV_16UC1)}); }), "");
    EXPECT_NE(error_of([&] { RawlogWriter w(folder / "no/such/dir.rawlog", test_rig()); }), "");
}

}  // namespace
}  // namespace vio
