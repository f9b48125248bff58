// Bags of ROS 2, made in both storages; one file is another program's.
#include <gtest/gtest.h>

#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "libvio/camera/fisheye.h"
#include "libvio/camera/perspective.h"
#include "libvio/io/image_depth.h"
#include "libvio/io/recording.h"
#include "libvio/io/text.h"
#include "libvio/io/trajectory_io.h"
#include "libvio/ros2/bag.h"
#include "libvio/ros2/messages.h"
#include "libvio/ros2/ros2_import.h"
#include "tests/unit/read_all.h"
#include "tests/unit/ros2_bag_writer.h"
#include "tests/unit/scratch_folder.h"

namespace vio {
namespace {

namespace fs = std::filesystem;
using test::BagMessage;
using test::Blob;
using test::CdrWriter;
using test::error_of;
using test::read_all;
using test::ScratchFolder;

constexpr TimeNs kBagStart = 1'700'000'000'123'456'700;

BagMessage imu_message(TimeNs t, double rate, double accel, const char* topic = "/imu0") {
    CdrWriter message;
    message.header(t, "imu")
        .zeros(13)
        .doubles(rate, 0.2, 0.3)
        .zeros(9)
        .doubles(1, 2, accel)
        .zeros(9);
    return {topic, "sensor_msgs/msg/Imu", message.bytes()};
}

Blob image_data(TimeNs t, int width, int height, const char* encoding, bool big_endian, int step,
                const Blob& pixels) {
    CdrWriter message;
    message.header(t, "camera") << static_cast<std::uint32_t>(height)
                                << static_cast<std::uint32_t>(width) << encoding
                                << static_cast<std::uint8_t>(big_endian)
                                << static_cast<std::uint32_t>(step) << pixels;
    return message.bytes();
}

BagMessage image_message(TimeNs t, std::uint8_t first = 0, const char* topic = "/cam0/image_raw") {
    Blob pixels;
    for (int i = 0; i < 4 * 6; ++i) pixels.push_back(static_cast<std::uint8_t>(first + i));
    return {topic, "sensor_msgs/msg/Image", image_data(t, 6, 4, "mono8", false, 6, pixels)};
}

Blob camera_info_data(const char* model, const std::vector<double>& distortion,
                      std::uint32_t binning = 0) {
    CdrWriter message;
    message.header(kBagStart, "camera") << std::uint32_t{4} << std::uint32_t{6} << model
                                        << static_cast<std::uint32_t>(distortion.size());
    for (const double k : distortion) message << k;
    message.doubles(5, 0, 2.5, 0, 5.5, 1.5, 0, 0, 1).zeros(9);
    message.doubles(4, 0, 2, 0, 0, 4.5, 1, 0, 0, 0, 1, 0);
    message << binning << binning;
    for (int i = 0; i < 4; ++i) message << std::uint32_t{0};
    message << std::uint8_t{0};
    return message.bytes();
}

BagMessage camera_info_message(const char* topic = "/cam0/camera_info") {
    return {topic, "sensor_msgs/msg/CameraInfo",
            camera_info_data("plumb_bob", {-0.1, 0.01, 0.001, 0.002, 0})};
}

// imu on base_link at (1, 2, 3); camera there at (1.1, 2.2, 3.3), turned.
BagMessage transforms_message() {
    CdrWriter message;
    message << std::uint32_t{2};
    message.header(0, "base_link") << "imu";
    message.doubles(1, 2, 3, 0, 0, 0, 1);
    message.header(0, "base_link") << "camera";
    message.doubles(1.1, 2.2, 3.3, 0.5, -0.5, 0.5, -0.5);
    return {"/tf_static", "tf2_msgs/msg/TFMessage", message.bytes()};
}

BagMessage fix_message(TimeNs t) {
    CdrWriter message;
    message.header(t, "gps") << std::int8_t{1} << std::uint16_t{1};
    message.doubles(49.5, 8.25, 116).zeros(9) << std::uint8_t{2};
    return {"/fix", "sensor_msgs/msg/NavSatFix", message.bytes()};
}

BagMessage true_pose_message(TimeNs t, double x) {
    CdrWriter message;
    message.header(t, "world").doubles(x, -1, 2, 0, 0, 0.6, 0.8);
    return {"/truth", "geometry_msgs/msg/PoseStamped", message.bytes()};
}

std::vector<BagMessage> whole_bag() {
    std::vector<BagMessage> messages = {transforms_message(), camera_info_message()};
    for (int i = 0; i < 10; ++i) {
        const TimeNs t = kBagStart + i * 5'000'000;
        messages.push_back(imu_message(t, 0.1 + i, 9.5));
        if (i % 5 == 0) messages.push_back(image_message(t, static_cast<std::uint8_t>(i)));
        if (i % 5 == 0) messages.push_back(fix_message(t));
        messages.push_back(true_pose_message(t, i));
    }
    return messages;
}

class Ros2Import : public ::testing::Test {
 protected:
    std::string sqlite(const std::vector<BagMessage>& messages) {
        test::write_sqlite_bag(folder_ / "bag.db3", messages);
        return folder_ / "bag.db3";
    }
    std::string mcap(const std::vector<BagMessage>& messages,
                     const std::string& compression = "zstd") {
        test::write_mcap_bag(folder_ / "bag.mcap", messages, compression);
        return folder_ / "bag.mcap";
    }
    ImportReport run(const std::string& bag) { return import_ros2(bag, out(), options_); }
    std::string refusal(const std::string& bag) {
        const std::string message = error_of([&] { run(bag); });
        EXPECT_EQ(message.find('\n'), std::string::npos) << message;
        EXPECT_FALSE(fs::exists(out()) || fs::exists(out() + ".partial")) << message;
        return message;
    }
    std::string out() const { return folder_ / "out.rawlog"; }

    ScratchFolder folder_;
    Ros2ImportOptions options_;
};

void expect_has(const std::string& text, const std::string& part) {
    EXPECT_NE(text.find(part), std::string::npos) << text;
}

// The file was written by @mcap/core with @foxglove/rosmsg2-serialization, by ROS 2 Jazzy's
// definitions: chunks in Zstandard, summary, rows of the image padded from six bytes to eight.
TEST_F(Ros2Import, ReadsABagOfAnotherProgram) {
    options_.truth_topic = "/truth";
    const auto report = run(std::string(VIO_SOURCE_DIR) + "/tests/unit/ros2_jazzy.mcap");
    EXPECT_EQ(report.images, 1);
    EXPECT_EQ(report.imu_readings, 3);
    EXPECT_TRUE(report.left_out.empty());
    const auto readings = read_all<ImuReading>(out());
    ASSERT_EQ(readings.size(), 3u);
    EXPECT_EQ(readings[2].t, kBagStart + 10'000'000);
    EXPECT_EQ(readings[2].gyro, Eigen::Vector3d(2.1, 0.2, 0.3));
    EXPECT_EQ(readings[2].accel, Eigen::Vector3d(1, 2, 11.5));
    const auto images = read_all<ImageMessage>(out());
    ASSERT_EQ(images.size(), 1u);
    for (int row = 0; row < 4; ++row)
        for (int column = 0; column < 6; ++column)
            EXPECT_EQ(images[0].image.at<std::uint8_t>(row, column), 10 * row + column);
    const Recording recording(out());
    const auto camera = std::dynamic_pointer_cast<const PerspectiveCamera>(recording.rig().camera);
    ASSERT_TRUE(camera);
    EXPECT_EQ(camera->parameters().fy, 5.5);
    EXPECT_EQ(camera->parameters().distortion[3], 0.002);
    EXPECT_NEAR((recording.rig().T_B_C.p - Eigen::Vector3d(0.1, 0.2, 0.3)).norm(), 0, 1e-12);
    const auto truth = read_trajectory(report.truth_file);
    ASSERT_EQ(truth.size(), 3u);
    EXPECT_EQ(truth[2].T_W_B.p, Eigen::Vector3d(2, -1, 2));
}

TEST_F(Ros2Import, BothStoragesAndAllCompressionsGiveTheSameRecording) {
    options_.truth_topic = "/truth";
    const auto report = run(sqlite(whole_bag()));
    EXPECT_EQ(report.images, 2);
    EXPECT_EQ(report.imu_readings, 10);
    EXPECT_EQ(report.gps_fixes, 2);
    EXPECT_EQ(report.truth_poses, 10);
    EXPECT_EQ(report.first, kBagStart);
    EXPECT_EQ(report.last, kBagStart + 45'000'000);
    const auto readings = read_all<ImuReading>(out());
    ASSERT_EQ(readings.size(), 10u);
    EXPECT_EQ(readings[7].gyro, Eigen::Vector3d(7.1, 0.2, 0.3));
    const auto images = read_all<ImageMessage>(out());
    ASSERT_EQ(images.size(), 2u);
    EXPECT_EQ(images[1].image.at<std::uint8_t>(3, 5), 5 + 23);
    const auto fixes = read_all<GpsMessage>(out());
    ASSERT_EQ(fixes.size(), 2u);
    EXPECT_EQ(fixes[1].latitude_deg, 49.5);
    EXPECT_EQ(fixes[1].fix_quality, 2);
    // The quaternion (0.5, -0.5, 0.5, -0.5) takes the camera's z to the IMU's x.
    const Recording recording(out());
    EXPECT_NEAR((recording.rig().T_B_C.R.col(2) - Eigen::Vector3d::UnitX()).norm(), 0, 1e-12);
    const std::string expected = read_text(out());
    for (const char* compression : {"none", "", "lz4", "zstd"}) {
        run(mcap(whole_bag(), compression));
        EXPECT_EQ(read_text(out()), expected) << compression;
    }
    // Messages that were compressed one by one.
    auto packed = whole_bag();
    for (BagMessage& m : packed) m.data = test::zstd_packed(m.data);
    fs::remove(folder_ / "bag.db3");
    run(sqlite(packed));
    EXPECT_EQ(read_text(out()), expected);
}

TEST_F(Ros2Import, FolderListsItsFilesInTheirOrder) {
    auto messages = whole_bag();
    const std::vector<BagMessage> second(messages.begin() + 12, messages.end());
    messages.resize(12);
    fs::create_directories(folder_ / "b");
    test::write_sqlite_bag(folder_ / "b/b_0.db3", messages);
    test::write_sqlite_bag(folder_ / "b/b_1.db3", second);
    write_text(folder_ / "b/metadata.yaml",
               "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: sqlite3\n"
               "  relative_file_paths:\n    - b/b_0.db3\n    - b_1.db3\n");
    const auto report = run(folder_ / "b");
    EXPECT_EQ(report.imu_readings, 10);
    EXPECT_TRUE(report.left_out.empty());
    fs::remove(out());
    fs::remove(folder_ / "b/b_1.db3");
    expect_has(refusal(folder_ / "b"), "b_1.db3: no such file; is the bag complete?");
    fs::remove(folder_ / "b/metadata.yaml");
    expect_has(refusal(folder_ / "b"), "holds no metadata.yaml");
}

TEST_F(Ros2Import, TopicsAreNamedWhereThereAreSeveral) {
    auto messages = whole_bag();
    messages.push_back(imu_message(kBagStart, 5, 5, "/other"));
    const std::string bag = mcap(messages);
    expect_has(refusal(bag),
               "has 2 topics of sensor_msgs/msg/Imu (/imu0, /other); name one with "
               "--imu-topic");
    options_.imu_topic = "/other";
    EXPECT_EQ(run(bag).imu_readings, 1);
    fs::remove(out());
    options_.imu_topic = "/imu1";
    expect_has(refusal(bag), "has no topic /imu1; of sensor_msgs/msg/Imu: /imu0, /other");
    options_.imu_topic = "/fix";
    expect_has(refusal(bag), "/fix is of type sensor_msgs/msg/NavSatFix");
    options_ = {};
    options_.truth_topic = "/fix";
    options_.imu_topic = "/imu0";
    expect_has(refusal(bag), "/fix is of type sensor_msgs/msg/NavSatFix; expected one of geometry");
    options_ = {};
    expect_has(refusal(mcap({fix_message(kBagStart)})), "has no topic of sensor_msgs/msg/Image");
}

TEST_F(Ros2Import, GyroAndAccelerometerMayBeTopicsOfTheirOwn) {
    std::vector<BagMessage> messages;
    for (int i = 0; i < 5; ++i)
        messages.push_back(imu_message(kBagStart + i * 10'000'000, i, 0, "/gyro"));
    for (int i = 0; i < 4; ++i)
        messages.push_back(imu_message(kBagStart + 5'000'000 + i * 10'000'000, 0, 9 + i, "/accel"));
    options_.imu_topic = "/gyro";
    options_.accel_topic = "/accel";
    const auto report = run(mcap(messages));
    EXPECT_EQ(report.left_out.total(), 2);  // before the first acceleration and after the last
    const auto readings = read_all<ImuReading>(out());
    ASSERT_EQ(readings.size(), 3u);
    EXPECT_EQ(readings[1].gyro.x(), 2);
    EXPECT_NEAR(readings[1].accel.z(), 10.5, 1e-12);
}

TEST_F(Ros2Import, MessagesWithoutATimeOfTheirOwnAreLeftOut) {
    auto messages = whole_bag();
    messages.insert(messages.begin() + 8, imu_message(0, 1, 1));
    messages.insert(messages.begin() + 8, imu_message(kBagStart, 1, 1));
    messages.push_back(imu_message(kBagStart + 1'000'000'000, std::nan(""), 1));
    messages.push_back(imu_message(kBagStart + 2'000'000'000, 1, 1));
    messages.back().data.resize(100);
    const auto report = run(mcap(messages));
    EXPECT_EQ(report.imu_readings, 10);
    ASSERT_EQ(report.left_out.kinds().size(), 1u);
    EXPECT_EQ(report.left_out.kinds()[0].what, "messages of /imu0");
    EXPECT_EQ(report.left_out.kinds()[0].count, 4);
    expect_has(report.left_out.kinds()[0].first,
               "bag.mcap (topic /imu0, message 3): its stamp is not later");
    fs::remove(out());
    expect_has(refusal(mcap({imu_message(0, 1, 1), imu_message(0, 2, 2)})),
               "(topic /imu0, message 1): its header bears no time stamp");
}

TEST_F(Ros2Import, SaysWhatCalibrationIsMissing) {
    const auto report = run(mcap({imu_message(kBagStart, 1, 1), image_message(kBagStart)}));
    std::string remarks;
    for (const std::string& remark : report.remarks) remarks += remark + "\n";
    expect_has(remarks, "the bag has no intrinsics of the camera");
    expect_has(remarks, "does not say where the camera is on the IMU");
    EXPECT_FALSE(Recording(out()).rig().camera);
}

TEST_F(Ros2Import, RectifiedImagesHaveTheRectifiedIntrinsics) {
    run(mcap({imu_message(kBagStart, 1, 1), image_message(kBagStart, 0, "/cam0/image_rect"),
              camera_info_message()}));
    const Recording recording(out());
    const auto camera = std::dynamic_pointer_cast<const PerspectiveCamera>(recording.rig().camera);
    ASSERT_TRUE(camera);
    EXPECT_EQ(camera->parameters().fx, 4);
    EXPECT_EQ(camera->parameters().cy, 1);
    EXPECT_EQ(camera->parameters().distortion[0], 0);
}

TEST_F(Ros2Import, CompressedImagesAreDecoded) {
    cv::Mat pixels(4, 6, CV_8UC1);
    cv::randu(pixels, 0, 256);
    Blob png;
    cv::imencode(".png", pixels, png);
    CdrWriter message;
    message.header(kBagStart, "camera") << "mono8; png compressed" << png;
    CdrWriter damaged;
    damaged.header(kBagStart + 1, "camera") << "jpeg" << Blob{1, 2, 3};
    const char* type = "sensor_msgs/msg/CompressedImage";
    const char* topic = "/cam0/image_raw/compressed";
    const auto report = run(mcap(
        {{topic, type, message.bytes()}, {topic, type, damaged.bytes()}, camera_info_message()}));
    EXPECT_EQ(report.images, 1);
    EXPECT_EQ(report.left_out.total(), 1);
    const auto images = read_all<ImageMessage>(out());
    EXPECT_EQ(cv::norm(images[0].image, pixels, cv::NORM_INF), 0);
    EXPECT_TRUE(Recording(out()).rig().camera);
}

// In 8 bits, of 16 the highest.
cv::Mat decoded(const char* encoding, int width, int step, const Blob& pixels,
                bool big_endian = false) {
    const Blob data = image_data(kBagStart, width, 4, encoding, big_endian, step, pixels);
    Cdr cdr(data, "here");
    read_header(cdr);
    return BitDepth(16).to_8_bit(read_image(cdr));
}

TEST(Ros2Messages, EveryEncodingBecomesGrey) {
    // One colour over the whole image: red 200, green 100, blue 50.
    const int grey = 124;  // 0.299 R + 0.587 G + 0.114 B = 124.2
    const auto repeated = [](const Blob& pattern, int times) {
        Blob all;
        while (times-- > 0) all.insert(all.end(), pattern.begin(), pattern.end());
        return all;
    };
    const auto expect_grey = [&](const cv::Mat& image, int value, const char* encoding) {
        ASSERT_EQ(image.type(), CV_8UC1) << encoding;
        ASSERT_EQ(image.size(), cv::Size(6, 4)) << encoding;
        EXPECT_LE(cv::norm(image, cv::Mat(4, 6, CV_8UC1, cv::Scalar(value)), cv::NORM_INF), 1)
            << encoding;
    };
    expect_grey(decoded("rgb8", 6, 18, repeated({200, 100, 50}, 24)), grey, "rgb8");
    expect_grey(decoded("bgr8", 6, 18, repeated({50, 100, 200}, 24)), grey, "bgr8");
    expect_grey(decoded("8UC3", 6, 18, repeated({50, 100, 200}, 24)), grey, "8UC3");
    expect_grey(decoded("rgba8", 6, 24, repeated({200, 100, 50, 9}, 24)), grey, "rgba8");
    expect_grey(decoded("bgra8", 6, 24, repeated({50, 100, 200, 9}, 24)), grey, "bgra8");
    expect_grey(decoded("rgb16", 6, 36, repeated({0, 200, 0, 100, 0, 50}, 24)), grey, "rgb16");
    expect_grey(decoded("rgb16", 6, 36, repeated({200, 0, 100, 0, 50, 0}, 24), true), grey,
                "rgb16, big-endian");
    expect_grey(decoded("yuv422", 6, 12, repeated({128, 90, 128, 90}, 12)), 90, "yuv422");
    expect_grey(decoded("yuv422_yuy2", 6, 12, repeated({90, 128, 90, 128}, 12)), 90, "yuy2");
    const auto mosaic = [&](std::uint8_t a, std::uint8_t b, std::uint8_t c, std::uint8_t d) {
        Blob pixels;
        for (int row = 0; row < 4; ++row)
            for (int column = 0; column < 6; ++column)
                pixels.push_back(row % 2 ? (column % 2 ? d : c) : (column % 2 ? b : a));
        return pixels;
    };
    expect_grey(decoded("bayer_rggb8", 6, 6, mosaic(200, 100, 100, 50)), grey, "rggb");
    expect_grey(decoded("bayer_bggr8", 6, 6, mosaic(50, 100, 100, 200)), grey, "bggr");
    expect_grey(decoded("bayer_gbrg8", 6, 6, mosaic(100, 50, 200, 100)), grey, "gbrg");
    expect_grey(decoded("bayer_grbg8", 6, 6, mosaic(100, 200, 50, 100)), grey, "grbg");
    // Sixteen bits: the upper eight, never rounded up.
    Blob deep;
    for (int i = 0; i < 24; ++i) deep.insert(deep.end(), {255, static_cast<std::uint8_t>(i)});
    const cv::Mat upper = decoded("mono16", 6, 12, deep);
    for (int i = 0; i < 24; ++i) EXPECT_EQ(upper.at<std::uint8_t>(i / 6, i % 6), i);
    EXPECT_NE(error_of([&] { decoded("32FC1", 6, 24, repeated({0}, 96)); }).find("'32FC1'"),
              std::string::npos);
    EXPECT_NE(error_of([&] { decoded("mono8", 6, 6, repeated({0}, 23)); }).find("size"),
              std::string::npos);
    EXPECT_NE(error_of([&] { decoded("mono8", 6, 5, repeated({0}, 24)); }).find("size"),
              std::string::npos);
}

TEST(Ros2Messages, EitherByteOrderIsRead) {
    for (const bool big_endian : {false, true}) {
        CdrWriter message(big_endian);
        message.header(kBagStart, "f").zeros(13).doubles(1, 2, 3).zeros(9).doubles(4, 5, 6);
        Cdr cdr(message.bytes(), "here");
        const auto header = read_header(cdr);
        EXPECT_EQ(header.t, kBagStart);
        EXPECT_EQ(header.frame, "f");
        const auto reading = read_imu(cdr, header.t);
        EXPECT_EQ(reading.gyro, Eigen::Vector3d(1, 2, 3));
        EXPECT_EQ(reading.accel, Eigen::Vector3d(4, 5, 6));
    }
    Blob other = CdrWriter().bytes();
    other[1] = 7;  // XCDR 2
    EXPECT_NE(error_of([&] { Cdr(other, "here"); }).find("here: is not serialised as plain CDR"),
              std::string::npos);
}

TEST(Ros2Messages, CameraInfoByItsModel) {
    const auto camera_of = [](const Blob& data) {
        Cdr cdr(data, "here");
        read_header(cdr);
        return read_camera_info(cdr, false);
    };
    const auto fisheye = std::dynamic_pointer_cast<const FisheyeCamera>(
        camera_of(camera_info_data("equidistant", {0.1, 0.2, 0.3, 0.4})));
    ASSERT_TRUE(fisheye);
    EXPECT_EQ(fisheye->parameters().k[3], 0.4);
    EXPECT_TRUE(camera_of(camera_info_data("", {})));
    const auto says = [&](const Blob& data) { return error_of([&] { camera_of(data); }); };
    EXPECT_NE(says(camera_info_data("fancy", {1})).find("'fancy' is not known"), std::string::npos);
    EXPECT_NE(says(camera_info_data("plumb_bob", {}, 2)).find("binning"), std::string::npos);
    EXPECT_NE(says(camera_info_data("equidistant", {1, 2, 3, 4, 5})).find("more coefficients"),
              std::string::npos);
}

// A recorder that was killed leaves neither a summary nor the last chunk's end.
TEST_F(Ros2Import, CutOffMcapKeepsWhatStandsBefore) {
    const std::string bag = mcap(whole_bag());
    const std::string whole = read_text(bag);
    int last = -1, with_readings = 0;
    for (std::size_t length = 0; length < whole.size(); length += 7) {
        std::ofstream(bag, std::ios::binary) << whole.substr(0, length);
        fs::remove(out());
        try {
            const auto report = run(bag);
            EXPECT_GE(report.imu_readings, last);
            last = report.imu_readings;
            ++with_readings;
            if (length < whole.size() / 2) {
                ASSERT_FALSE(report.left_out.empty()) << length;
                expect_has(report.left_out.kinds().back().first, "the file is cut off");
            }
        } catch (const InputError& error) {
            EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
        }
    }
    EXPECT_EQ(last, 10);
    EXPECT_GT(with_readings, 20);
}

TEST_F(Ros2Import, DamagedChunkIsLeftOut) {
    for (const char* compression : {"", "lz4", "zstd"}) {
        std::vector<std::size_t> starts;
        test::write_mcap_bag(folder_ / "bag.mcap", whole_bag(), compression, &starts);
        std::string bytes = read_text(folder_ / "bag.mcap");
        ASSERT_GT(starts.size(), 5u);
        // Behind the chunk's own fields: its content.
        bytes[starts[3] + 80] = static_cast<char>(~bytes[starts[3] + 80]);
        std::ofstream(folder_ / "bag.mcap", std::ios::binary) << bytes;
        const auto report = run(folder_ / "bag.mcap");
        EXPECT_LT(report.imu_readings, 10) << compression;
        EXPECT_GE(report.imu_readings, 7) << compression;
        ASSERT_FALSE(report.left_out.empty()) << compression;
        expect_has(report.left_out.kinds()[0].first, "the chunk is damaged");
    }
}

TEST_F(Ros2Import, ForeignFilesAreRefused) {
    const auto file = [&](const std::string& content) {
        std::ofstream(folder_ / "x", std::ios::binary) << content;
        return folder_ / "x";
    };
    expect_has(refusal(file("#ROSBAG V2.0\n")), "is no file of a ROS 2 bag");
    expect_has(refusal(file("\x28\xb5\x2f\xfd compressed")), "was compressed whole; unpack it");
    expect_has(refusal(file("SQLite format 3")), "cannot be read as a ROS 2 bag's database");
    expect_has(refusal(folder_ / "none"), "no such file");
    std::string half = read_text(sqlite(whole_bag()));
    EXPECT_NE(refusal(file(half.substr(0, half.size() / 2))), "");
}

}  // namespace
}  // namespace vio
