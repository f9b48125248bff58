// Import of ASL data sets, and trajectories as text.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "libvio/camera/fisheye.h"
#include "libvio/camera/perspective.h"
#include "libvio/io/asl_import.h"
#include "libvio/io/gz_stream.h"
#include "libvio/io/recording.h"
#include "libvio/io/text.h"
#include "libvio/io/trajectory_io.h"
#include "tests/unit/scratch_folder.h"

namespace vio {
namespace {

namespace fs = std::filesystem;
using test::error_of;
using test::ScratchFolder;

constexpr const char* kCameraYaml =
    "sensor_type: camera\n"
    "T_BS:\n  cols: 4\n  rows: 4\n"
    "  data: [0.0148655429818, -0.999880929698, 0.00414029679422, -0.0216401454975,\n"
    "         0.999557249008, 0.0149672133247, 0.025715529948, -0.064676986768,\n"
    "        -0.0257744366974, 0.00375618835797, 0.999660727178, 0.00981073058949,\n"
    "         0.0, 0.0, 0.0, 1.0]\n"
    "rate_hz: 20\nresolution: [64, 48]\ncamera_model: pinhole\n"
    "intrinsics: [458.654, 457.296, 367.215, 248.375] #fu, fv, cu, cv\n"
    "distortion_model: radial-tangential\n"
    "distortion_coefficients: [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]\n";

constexpr const char* kImuYaml =
    "sensor_type: imu\nT_BS:\n  cols: 4\n  rows: 4\n"
    "  data: [1.0, 0.0, 0.0, 0.5,\n 0.0, 1.0, 0.0, 0.0,\n 0.0, 0.0, 1.0, 0.0,\n"
    "         0.0, 0.0, 0.0, 1.0]\nrate_hz: 200\n"
    "gyroscope_noise_density: 1.6968e-04     # [ rad / s / sqrt(Hz) ]\n"
    "gyroscope_random_walk: 1.9393e-05\naccelerometer_noise_density: 2.0000e-3\n"
    "accelerometer_random_walk: 3.0000e-3\n";

// Stamps of the layout's own kind: nanoseconds that are not whole ticks of MRPT.
constexpr const char* kImuCsv =
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y,w_RS_S_z,a_RS_S_x,a_RS_S_y,a_RS_S_z\r\n"
    "1403636584758555520,-0.0963421747,0.1717403984,0.1780235837,8.41,0.269682875,-3.301\r\n"
    "1403636584763555584,0.1,0.2,0.3,4,5,6\r\n"
    "1403636584768555520,0.1,0.2,0.3,4,5,7\r\n";

class MiniDataSet : public ::testing::Test {
 protected:
    void SetUp() override {
        for (const char* dir : {"cam0/data", "imu0", "state_groundtruth_estimate0"})
            fs::create_directories(mav0(dir));
        write_text(mav0("cam0/sensor.yaml"), kCameraYaml);
        write_text(mav0("imu0/sensor.yaml"), kImuYaml);
        write_text(mav0("imu0/data.csv"), kImuCsv);
    }

    void add_images() {
        std::string csv = "#timestamp [ns],filename\r\n";
        for (const char* stamp : {"1403636584763555584", "1403636584813555456"}) {
            const std::string name = std::string(stamp) + ".png";
            cv::imwrite(mav0("cam0/data/" + name), image(csv.size()));
            csv += std::string(stamp) + "," + name + "\r\n";
        }
        write_text(mav0("cam0/data.csv"), csv);
    }

    void add_features(const std::string& rows) {
        GzOutput out(mav0("cam0/features.csv.gz"));
        const std::string text = "#timestamp [ns],corner_id [],u [px],v [px]\n" + rows;
        out.Write(text.data(), text.size());
        out.close();
    }

    void add_truth() {
        write_text(mav0("state_groundtruth_estimate0/data.csv"),
                   "#timestamp, p_RS_R_x [m], ..., q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []\n"
                   "1403636584763555584,4.6,-1.7,0.9,0.6,0.8,0,0,0.1,0.2,0.3,0,0,0,0,0,0\n");
        write_text(mav0("state_groundtruth_estimate0/sensor.yaml"),
                   "T_BS:\n  data: [1,0,0,0.25, 0,1,0,0, 0,0,1,0, 0,0,0,1]\n");
    }

    static cv::Mat image(std::size_t seed) {
        cv::Mat pixels(48, 64, CV_8UC1);
        cv::RNG(seed).fill(pixels, cv::RNG::UNIFORM, 0, 256);
        return pixels;
    }

    std::string mav0(const std::string& name) const { return folder_ / ("mav0/" + name); }
    std::string out() const { return folder_ / "out.rawlog"; }
    ImportReport run() const { return import_asl(folder_.path().string(), out()); }
    std::string error() const {
        return error_of([&] { run(); });
    }

    ScratchFolder folder_;
};

TEST_F(MiniDataSet, ImagesArriveInOrderWithCalibration) {
    add_images();
    const auto report = run();
    EXPECT_EQ(report.images, 2);
    EXPECT_EQ(report.imu_readings, 3);
    EXPECT_EQ(report.feature_frames, 0);
    EXPECT_EQ(report.first, 1403636584758555520);
    EXPECT_EQ(report.last, 1403636584813555456);
    EXPECT_EQ(report.truth_file, "");

    Recording recording(out());
    std::vector<Message> messages;
    while (auto message = recording.next()) messages.push_back(*message);
    ASSERT_EQ(messages.size(), 5u);
    const auto& imu = std::get<ImuReading>(messages[0]);
    EXPECT_EQ(imu.t, 1403636584758555500);
    EXPECT_EQ(imu.gyro, Eigen::Vector3d(-0.0963421747, 0.1717403984, 0.1780235837));
    EXPECT_EQ(imu.accel, Eigen::Vector3d(8.41, 0.269682875, -3.301));
    // A reading and an image with one stamp keep one stamp, the reading first.
    EXPECT_EQ(std::get<ImuReading>(messages[1]).t, 1403636584763555500);
    EXPECT_EQ(std::get<ImageMessage>(messages[2]).t, 1403636584763555500);
    const auto& last = std::get<ImageMessage>(messages[4]);
    EXPECT_EQ(last.t, 1403636584813555400);
    const cv::Mat expected =
        cv::imread(mav0("cam0/data/1403636584813555456.png"), cv::IMREAD_GRAYSCALE);
    EXPECT_EQ(cv::norm(last.image, expected, cv::NORM_INF), 0);

    const Rig& rig = recording.rig();
    const auto& camera = dynamic_cast<const PerspectiveCamera&>(*rig.camera).parameters();
    EXPECT_EQ(camera.width, 64);
    EXPECT_EQ(camera.fy, 457.296);
    EXPECT_EQ(camera.distortion[3], 1.76187114e-05);
    EXPECT_EQ(rig.T_B_C.p, Eigen::Vector3d(-0.0216401454975, -0.064676986768, 0.00981073058949));
    EXPECT_NEAR(rig.T_B_C.R(0, 1), -0.999880929698, 1e-10);
    EXPECT_LT((rig.T_B_C.R * rig.T_B_C.R.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-14);
    EXPECT_EQ(rig.T_B_I.p, Eigen::Vector3d(0.5, 0, 0));
    EXPECT_EQ(rig.imu_noise.gyro_noise_density, 1.6968e-4);
    EXPECT_EQ(rig.imu_noise.gyro_bias_random_walk, 1.9393e-5);
    EXPECT_EQ(rig.imu_noise.accel_noise_density, 2e-3);
    EXPECT_EQ(rig.imu_noise.accel_bias_random_walk, 3e-3);
}

TEST_F(MiniDataSet, FeaturesArriveAsFrames) {
    add_features(
        "1403636584763555584,7,175.9867,336.8252\n"
        "1403636584763555584,1,213.3339,334.5095,extra\n"
        "1403636584813555456,7,1,2\n");
    EXPECT_EQ(run().feature_frames, 2);
    Recording recording(out());
    EXPECT_TRUE(recording.has_features());
    EXPECT_FALSE(recording.has_images());
    EXPECT_TRUE(recording.rig().camera);
    std::vector<FeatureFrame> frames;
    while (auto message = recording.next())
        if (const auto* frame = std::get_if<FeatureFrame>(&*message)) frames.push_back(*frame);
    ASSERT_EQ(frames.size(), 2u);
    ASSERT_EQ(frames[0].features.size(), 2u);
    EXPECT_EQ(frames[0].t, 1403636584763555500);
    EXPECT_EQ(frames[0].features[1].feature_id, 1);
    EXPECT_EQ(frames[0].features[1].uv_px, Eigen::Vector2d(213.3339, 334.5095));
    EXPECT_EQ(frames[1].features[0].feature_id, 7);
}

TEST_F(MiniDataSet, GroundTruthBecomesBodyPoses) {
    add_images();
    add_truth();
    const auto report = run();
    EXPECT_EQ(report.truth_poses, 1);
    EXPECT_EQ(report.truth_file, folder_ / "out.truth.tum");
    const auto poses = read_trajectory(report.truth_file);
    ASSERT_EQ(poses.size(), 1u);
    EXPECT_EQ(poses[0].t, 1403636584763555584);
    const Eigen::Matrix3d R = Eigen::Quaterniond(0.6, 0.8, 0, 0).toRotationMatrix();
    EXPECT_LT((poses[0].T_W_B.R - R).norm(), 1e-15);
    // The truth is of a sensor 0.25 m along B's x axis, which the rotation about x leaves alone.
    EXPECT_LT((poses[0].T_W_B.p - Eigen::Vector3d(4.35, -1.7, 0.9)).norm(), 1e-12);
}

TEST_F(MiniDataSet, AcceptsTheInnerFolderAndNoImu) {
    add_images();
    fs::remove_all(mav0("imu0"));
    EXPECT_EQ(import_asl(mav0(""), out()).images, 2);
    EXPECT_FALSE(Recording(out()).has_imu());
}

TEST_F(MiniDataSet, FisheyeCalibrationIsCarried) {
    add_images();
    std::string yaml = kCameraYaml;
    yaml.replace(yaml.find("radial-tangential"), 17, "equidistant");
    write_text(mav0("cam0/sensor.yaml"), yaml);
    run();
    const Recording recording(out());
    const auto fisheye = std::dynamic_pointer_cast<const FisheyeCamera>(recording.rig().camera);
    ASSERT_TRUE(fisheye);
    EXPECT_EQ(fisheye->parameters().fy, 457.296);
    EXPECT_EQ(fisheye->parameters().k,
              (std::array<double, 4>{-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05}));
}

TEST_F(MiniDataSet, BadRowsAreNamed) {
    add_images();
    const auto with = [&](const char* file, const std::string& text) {
        const std::string good = read_text(mav0(file));
        write_text(mav0(file), good + text);
        const std::string message = error();
        write_text(mav0(file), good);
        EXPECT_FALSE(fs::exists(out())) << file;
        return message;
    };
    EXPECT_NE(with("imu0/data.csv", "1403636584773555520,1,2\n").find("imu0/data.csv (line 5)"),
              std::string::npos);
    EXPECT_NE(with("imu0/data.csv", "1403636584773555520,1,2,x3,4,5,6\n").find("'x3'"),
              std::string::npos);
    EXPECT_NE(with("imu0/data.csv", "1403636584768555520,1,2,3,4,5,6\n").find("not later"),
              std::string::npos);
    EXPECT_NE(with("cam0/data.csv", "14036365848.6,none.png\n").find("(line 4)"),
              std::string::npos);
    EXPECT_EQ(error(), "");
}

// What one measurement lacks costs that measurement alone: reading goes on behind it.
TEST_F(MiniDataSet, UnusableMeasurementsAreLeftOutAndTold) {
    add_images();
    const auto whole = run();
    const std::string imu = read_text(mav0("imu0/data.csv")),
                      images = read_text(mav0("cam0/data.csv"));
    write_text(mav0("imu0/data.csv"), imu +
                                          "1403636584773555520,1,2,nan,4,5,6\n"
                                          "1403636584778555520,1,2,3,4,5,-inf\n"
                                          "1403636584783555520,1,2,3,4,5,6\n");
    write_text(mav0("cam0/data.csv"), images + "1403636584863555456,none.png\n");
    const auto report = run();
    EXPECT_EQ(report.imu_readings, whole.imu_readings + 1);
    EXPECT_EQ(report.images, whole.images);
    ASSERT_EQ(report.left_out.kinds().size(), 2u);
    const LeftOut& readings = report.left_out.kinds()[0];
    EXPECT_EQ(readings.what, "IMU readings");
    EXPECT_EQ(readings.count, 2);
    EXPECT_EQ(readings.first, mav0("imu0/data.csv") + " (line 5): 'nan' is not a finite number");
    EXPECT_EQ(one_line(report.left_out.kinds()[1]).find("1 images: " + mav0("cam0/data.csv")), 0u)
        << one_line(report.left_out.kinds()[1]);
    EXPECT_EQ(whole.left_out.total(), 0);
}

// A data set may have no IMU; one that was asked for it must have.
TEST_F(MiniDataSet, NamedFoldersMustBeThere) {
    add_images();
    AslImportOptions options;
    options.imu = "imu1";
    EXPECT_EQ(error_of([&] { import_asl(folder_.path().string(), out(), options); }),
              mav0("imu1") + ": no such folder; there are cam0, imu0");
    options.imu = "imu0";
    options.camera = "cam1";
    EXPECT_EQ(error_of([&] { import_asl(folder_.path().string(), out(), options); }),
              mav0("cam1") + ": no such folder; there are cam0, imu0");
    EXPECT_FALSE(fs::exists(out()));
    options.camera = "cam0";
    EXPECT_EQ(import_asl(folder_.path().string(), out(), options).imu_readings, 3);
    write_text(mav0("imu0/data.csv"), "#timestamp\n");
    EXPECT_EQ(error(), mav0("imu0/data.csv") + ": holds no readings");
    fs::remove_all(mav0("imu0"));
    EXPECT_EQ(error(), "");
    EXPECT_NE(error_of([&] { import_asl(folder_.path().string(), out(), options); }), "");
}

// Of a stream in which nothing can be used, something else is wrong.
TEST_F(MiniDataSet, StreamsWithoutAnyUsableMeasurementAreRefused) {
    add_images();
    write_text(mav0("imu0/data.csv"), "1,1,2,nan,4,5,6\n2,1,2,3,nan,5,6\n");
    const std::string message = error();
    EXPECT_NE(message.find("imu0/data.csv (line 1): 'nan' is not a finite number"),
              std::string::npos)
        << message;
    EXPECT_NE(message.find("all had to be left out: 2"), std::string::npos) << message;
    EXPECT_FALSE(fs::exists(out()));
}

TEST_F(MiniDataSet, BadFeatureRowsAreNamed) {
    add_features("10,7,1,2\n10,7,3,4\n");
    EXPECT_NE(error().find("features.csv.gz (line 3): feature 7 appears twice"), std::string::npos)
        << error();
    add_features("10,7,1,2\n20,7,3\n");
    EXPECT_NE(error().find("(line 3)"), std::string::npos) << error();
    add_features("20,7,1,2\n10,7,3,4\n");
    EXPECT_NE(error().find("not later"), std::string::npos) << error();
}

TEST_F(MiniDataSet, BadCalibrationIsNamed) {
    add_images();
    const auto with = [&](const std::string& from, const std::string& to) {
        std::string yaml = kCameraYaml;
        yaml.replace(yaml.find(from), from.size(), to);
        write_text(mav0("cam0/sensor.yaml"), yaml);
        return error();
    };
    EXPECT_NE(with("radial-tangential", "magic").find("cam0/sensor.yaml (distortion_model)"),
              std::string::npos);
    EXPECT_NE(with("intrinsics", "intrinsic").find("(intrinsics): is missing"), std::string::npos);
    EXPECT_NE(with("0.999557249008", "0.5").find("(T_BS)"), std::string::npos);
    EXPECT_NE(with("T_BS", "T_SB").find("(T_BS): is missing"), std::string::npos);
    EXPECT_NE(with("pinhole", "ocam").find("(camera_model)"), std::string::npos);
    fs::remove(mav0("cam0/sensor.yaml"));
    EXPECT_NE(error().find("no such file"), std::string::npos);
    EXPECT_NE(error_of([&] { import_asl(folder_ / "none", out()); }).find("no such folder"),
              std::string::npos);
}

TEST(Trajectory, SecondsAreParsedExactly) {
    EXPECT_EQ(parse_seconds("1403636584.763555584"), 1403636584763555584);
    EXPECT_EQ(parse_seconds("1.403636584763555584e+09"), 1403636584763555584);
    EXPECT_EQ(parse_seconds("1403636584"), 1403636584000000000);
    EXPECT_EQ(parse_seconds("0.1"), 100000000);
    EXPECT_EQ(parse_seconds("-0.0000000015"), -2);
    EXPECT_EQ(parse_seconds("5e-10"), 1);
    EXPECT_EQ(parse_seconds("4e-10"), 0);
    EXPECT_EQ(parse_seconds("1e-30"), 0);
    EXPECT_EQ(parse_seconds(".5"), 500000000);
    EXPECT_EQ(parse_seconds("9223372036.854775807"), std::numeric_limits<TimeNs>::max());
    EXPECT_EQ(parse_seconds("9223372036.854775808"), std::nullopt);
    for (const char* bad : {"", ".", "-", "1.2.3", "1e", "abc", "1 2", "nan", "0x10", "1e999999"})
        EXPECT_EQ(parse_seconds(bad), std::nullopt) << bad;
    for (const TimeNs t : {TimeNs{0}, TimeNs{1403636584763555584}, TimeNs{-1500000001}})
        EXPECT_EQ(parse_seconds(format_seconds(t)), t);
}

TEST(Trajectory, TumRoundTripIsExact) {
    ScratchFolder folder;
    std::vector<TimedPose> poses;
    for (int i = 0; i < 5; ++i)
        poses.push_back({1403636584763555584 + i,
                         {so3::exp({0.7 * i, -1.1 * i, 0.3}), {1.0 / 3, -2e-7 * i, 1e6}}});
    write_tum(folder / "a.tum", poses, "T_W_B");
    const auto read = read_trajectory(folder / "a.tum");
    ASSERT_EQ(read.size(), poses.size());
    for (std::size_t i = 0; i < poses.size(); ++i) {
        EXPECT_EQ(read[i].t, poses[i].t);
        EXPECT_EQ(read[i].T_W_B.p, poses[i].T_W_B.p);
        EXPECT_LT((read[i].T_W_B.R - poses[i].T_W_B.R).norm(), 1e-14);
    }
    EXPECT_EQ(read_text(folder / "a.tum").substr(0, 2), "# ");
}

TEST(Trajectory, BadFilesAreNamedWithLine) {
    ScratchFolder folder;
    const auto error = [&](const std::string& text) {
        write_text(folder / "a.tum", text);
        return error_of([&] { read_trajectory(folder / "a.tum"); });
    };
    EXPECT_NE(error("# only a comment\n").find("no poses"), std::string::npos);
    EXPECT_NE(error("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0\n").find("(line 2)"), std::string::npos);
    EXPECT_NE(error("1 0 0 0 0 0 0 2\n").find("quaternion"), std::string::npos);
    EXPECT_NE(error("1 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n").find("not later"), std::string::npos);
    EXPECT_NE(error("1 0 0 zero 0 0 0 1\n").find("'zero'"), std::string::npos);
    EXPECT_NE(error_of([&] { read_trajectory(folder / "none"); }).find("no such"),
              std::string::npos);
}

}  // namespace
}  // namespace vio
