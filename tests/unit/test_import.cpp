// Import of TUM-VI, KITTI and tables, on made files of their exact layouts; export to ASL.
#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "libvio/base/angles.h"
#include "libvio/camera/fisheye.h"
#include "libvio/camera/perspective.h"
#include "libvio/geometry/geodetic.h"
#include "libvio/io/asl_export.h"
#include "libvio/io/asl_import.h"
#include "libvio/io/calibration_file.h"
#include "libvio/io/csv_import.h"
#include "libvio/io/kitti_import.h"
#include "libvio/io/recording.h"
#include "libvio/io/text.h"
#include "libvio/io/trajectory_io.h"
#include "tests/unit/read_all.h"
#include "tests/unit/scratch_folder.h"

namespace vio {
namespace {

namespace fs = std::filesystem;
using test::error_of;
using test::read_all;
using test::ScratchFolder;

cv::Mat noise_image(int width, int height, int type, unsigned seed) {
    cv::Mat pixels(height, width, type);
    cv::RNG(seed).fill(pixels, cv::RNG::UNIFORM, 0, type == CV_16UC1 ? 65536 : 256);
    return pixels;
}

bool contains(const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
}

class Import : public ::testing::Test {
 protected:
    void write(const std::string& name, const std::string& text) {
        fs::create_directories(fs::path(folder_ / name).parent_path());
        write_text(folder_ / name, text);
    }
    void write_image(const std::string& name, const cv::Mat& image) {
        fs::create_directories(fs::path(folder_ / name).parent_path());
        cv::imwrite(folder_ / name, image);
    }
    // The message of an error that leaves no rawlog; must be one line.
    template <typename Call>
    std::string refusal(Call&& call) {
        const std::string message = error_of(call);
        EXPECT_FALSE(contains(message, "\n")) << message;
        EXPECT_FALSE(fs::exists(out())) << message;
        EXPECT_FALSE(fs::exists(out() + ".partial")) << message;
        return message;
    }
    std::string out() const { return folder_ / "out.rawlog"; }

    ScratchFolder folder_;
};

// --- TUM-VI: dso/camchain.yaml, dso/imu_config.yaml, mav0/ without sensor.yaml

constexpr const char* kCamchain =
    "cam0:\n  cam_overlaps: [1]\n  camera_model: pinhole\n"
    "  distortion_coeffs: [0.0034823894022493434, 0.0007150348452162257, -0.0020532361418706202,"
    " 0.00020293673591811182]\n  distortion_model: equidistant\n"
    "  intrinsics: [190.97847715128717, 190.9733070521226, 254.93170605935475, "
    "256.8974428996504]\n"
    "  resolution: [64, 48]\n  rostopic: /cam0/image_raw\n"
    "  T_cam_imu:\n"
    "  - [-0.99952504, 0.00750192, -0.02989013, 0.04557484]\n"
    "  - [0.02961534, -0.03439736, -0.99896935, -0.07116180]\n"
    "  - [-0.00852233, -0.99938008, 0.03415885, -0.04468125]\n"
    "  - [0.0, 0.0, 0.0, 1.0]\n"
    "cam1:\n  camera_model: pinhole\n  distortion_coeffs: [0.1, 0.2, 0.3, 0.4]\n"
    "  distortion_model: equidistant\n  intrinsics: [190.4, 190.4, 252.6, 254.9]\n"
    "  resolution: [64, 48]\n";
constexpr const char* kImuConfig =
    "#Accelerometers\naccelerometer_noise_density: 0.0014   #Noise density\n"
    "accelerometer_random_walk:   0.000086  #Bias random walk\n"
    "#Gyroscopes\ngyroscope_noise_density:     0.00008\n"
    "gyroscope_random_walk:       0.0000022\nrostopic: /imu0\nupdate_rate: 200.0\n";

class TumVi : public Import {
 protected:
    void SetUp() override {
        write("d/dso/camchain.yaml", kCamchain);
        write("d/dso/imu_config.yaml", kImuConfig);
        for (const char* cam : {"cam0", "cam1"}) {
            write(std::string("d/mav0/") + cam + "/data.csv",
                  "#timestamp [ns],filename\n1520530308199447626,1520530308199447626.png\n"
                  "1520530308249448626,1520530308249448626.png\n");
            write_image(std::string("d/mav0/") + cam + "/data/1520530308199447626.png", deep_);
            write_image(std::string("d/mav0/") + cam + "/data/1520530308249448626.png", deep_);
        }
        write("d/mav0/imu0/data.csv",
              "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
              "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n"
              "1520530308197000000,-0.1,0.2,0.3,9.2,0.1,-3.0\n"
              "1520530308202000000,-0.1,0.2,0.3,9.3,0.1,-3.0\n");
        write("d/mav0/mocap0/data.csv",
              "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], "
              "q_RS_y [], q_RS_z []\n1520530308206664626,0.7,1.1,1.3,0.6,0.8,0,0\n");
    }
    ImportReport run() { return import_tum_vi(folder_ / "d", out()); }

    cv::Mat deep_ = noise_image(64, 48, CV_16UC1, 3);
};

TEST_F(TumVi, FisheyeCalibrationImagesAndMotionCaptureArrive) {
    const auto report = run();
    EXPECT_EQ(report.images, 2);
    EXPECT_EQ(report.imu_readings, 2);
    EXPECT_EQ(report.truth_poses, 1);
    const Recording recording(out());
    const auto fisheye = std::dynamic_pointer_cast<const FisheyeCamera>(recording.rig().camera);
    ASSERT_TRUE(fisheye);
    EXPECT_EQ(fisheye->parameters().fx, 190.97847715128717);
    EXPECT_EQ(fisheye->parameters().k[2], -0.0020532361418706202);
    // T_cam_imu maps I to C; here B is I. Rounded to the file's eight digits.
    const Pose T_C_I = recording.rig().T_B_C.inverse();
    EXPECT_NEAR(T_C_I.R(1, 2), -0.99896935, 2e-8);
    EXPECT_NEAR(T_C_I.p.y(), -0.07116180, 1e-8);
    EXPECT_EQ(recording.rig().T_B_I.p, Eigen::Vector3d::Zero());
    EXPECT_EQ(recording.rig().imu_noise.gyro_noise_density, 8e-5);
    EXPECT_EQ(recording.rig().imu_noise.accel_bias_random_walk, 8.6e-5);
    // The upper eight bits of sixteen, rounded or cut.
    const auto images = read_all<ImageMessage>(out());
    ASSERT_EQ(images.size(), 2u);
    EXPECT_EQ(images[0].image.type(), CV_8UC1);
    cv::Mat scaled;
    deep_.convertTo(scaled, CV_64F, 1 / 256.0);
    cv::Mat found;
    images[0].image.convertTo(found, CV_64F);
    EXPECT_LE(cv::norm(scaled, found, cv::NORM_INF), 1.0);
    EXPECT_EQ(read_trajectory(report.truth_file).front().T_W_B.p, Eigen::Vector3d(0.7, 1.1, 1.3));
}

TEST_F(TumVi, TheOtherCameraMayBeTaken) {
    AslImportOptions options;
    options.camera = "cam1";
    import_tum_vi(folder_ / "d", out(), options);
    const Recording recording(out());
    EXPECT_EQ(dynamic_cast<const FisheyeCamera&>(*recording.rig().camera).parameters().cx, 252.6);
}

TEST_F(TumVi, WhatIsMissingIsNamed) {
    const auto asl = refusal([&] { import_asl(folder_ / "d", out()); });
    EXPECT_TRUE(contains(asl, "import tum-vi")) << asl;
    AslImportOptions options;
    options.camera = "cam2";
    const auto camera = refusal([&] { import_tum_vi(folder_ / "d", out(), options); });
    EXPECT_TRUE(contains(camera, "cam2: no such folder; there are cam0, cam1, imu0, mocap0"))
        << camera;
    write("d/mav0/imu0/data.csv", "1,2,3\n");
    const auto row = refusal([&] { run(); });
    EXPECT_TRUE(contains(row, "imu0/data.csv (line 1)")) << row;
    fs::remove(folder_ / "d/dso/imu_config.yaml");
    const auto noise = refusal([&] { run(); });
    EXPECT_TRUE(contains(noise, "imu_config.yaml: no such file")) << noise;
}

// --- KITTI raw

constexpr const char* kDataFormat =
    "lat:     latitude of the oxts-unit (deg)\nlon:     longitude of the oxts-unit (deg)\n"
    "alt:     altitude of the oxts-unit (m)\nroll:    roll angle (rad)\npitch:   pitch angle "
    "(rad)\n"
    "yaw:     heading (rad)\nvn:      velocity towards north (m/s)\n"
    "ve:      velocity towards east (m/s)\nvf:      forward velocity (m/s)\n"
    "vl:      leftward velocity (m/s)\nvu:      upward velocity (m/s)\n"
    "ax:      acceleration in x, i.e. in direction of vehicle front (m/s^2)\n"
    "ay:      acceleration in y (m/s^2)\naz:      acceleration in z (m/s^2)\n"
    "af:      forward acceleration (m/s^2)\nal:      leftward acceleration (m/s^2)\n"
    "au:      upward acceleration (m/s^2)\nwx:      angular rate around x (rad/s)\n"
    "wy:      angular rate around y (rad/s)\nwz:      angular rate around z (rad/s)\n"
    "wf:      angular rate around forward axis (rad/s)\nwl:      around leftward axis (rad/s)\n"
    "wu:      around upward axis (rad/s)\npos_accuracy:  position accuracy (m)\n"
    "vel_accuracy:  velocity accuracy (m/s)\nnavstat:       navigation status\n"
    "numsats:       number of satellites\nposmode:       position mode\n"
    "velmode:       velocity mode\norimode:       orientation mode\n";

// P_rect_00 without offset, P_rect_01 with a baseline of 0.54 m; R_rect_00 turns slightly.
constexpr const char* kCamToCam =
    "calib_time: 09-Jan-2012 13:57:47\ncorner_dist: 9.950000e-02\n"
    "S_00: 1.392000e+03 5.120000e+02\n"
    "K_00: 9.842439e+02 0.000000e+00 6.900000e+02 0.000000e+00 9.808141e+02 2.331966e+02 "
    "0.000000e+00 0.000000e+00 1.000000e+00\n"
    "D_00: -3.728755e-01 2.037299e-01 2.219027e-03 1.383707e-03 -7.233722e-02\n"
    "R_00: 1 0 0 0 1 0 0 0 1\nT_00: 0 0 0\n"
    "S_rect_00: 1.242000e+03 3.750000e+02\n"
    "R_rect_00: 9.999239e-01 9.837760e-03 -7.445048e-03 -9.869795e-03 9.999421e-01 -4.278459e-03 "
    "7.402527e-03 4.351614e-03 9.999631e-01\n"
    "P_rect_00: 7.215377e+02 0 6.095593e+02 0 0 7.215377e+02 1.728540e+02 0 0 0 1 0\n"
    "S_01: 1392 512\n"
    "K_01: 9.895267e+02 0 7.020000e+02 0 9.878386e+02 2.455590e+02 0 0 1\n"
    "D_01: -3.644661e-01 1.790019e-01 1.148107e-03 -6.298563e-04 -5.314062e-02\n"
    "R_01: 1 0 0 0 1 0 0 0 1\nT_01: -5.370000e-01 0 0\n"
    "S_rect_01: 1242 375\n"
    "R_rect_01: 1 0 0 0 1 0 0 0 1\n"
    "P_rect_01: 7.215377e+02 0 6.095593e+02 -3.875744e+02 0 7.215377e+02 1.728540e+02 0 0 0 1 0\n";
constexpr const char* kVeloToCam =
    "calib_time: 15-Mar-2012 11:37:16\nR: 0 -1 0 0 0 -1 1 0 0\nT: -0.004 -0.076 -0.272\n"
    "delta_f: 0 0\ndelta_c: 0 0\n";
constexpr const char* kImuToVelo =
    "calib_time: 25-May-2012 16:47:16\nR: 1 0 0 0 1 0 0 0 1\nT: -0.81 0.32 -0.80\n";

class Kitti : public Import {
 protected:
    static constexpr int kCount = 4;
    const std::string drive_ = "2011_09_26/2011_09_26_drive_0001_sync";

    void SetUp() override {
        write("2011_09_26/calib_cam_to_cam.txt", kCamToCam);
        write("2011_09_26/calib_velo_to_cam.txt", kVeloToCam);
        write("2011_09_26/calib_imu_to_velo.txt", kImuToVelo);
        std::string image_stamps, oxts_stamps;
        for (int i = 0; i < kCount; ++i) {
            const std::string number = "000000000" + std::to_string(i);
            image_stamps += "2011-09-26 13:02:25." + std::to_string(964 + 10 * i) + "389445\n";
            oxts_stamps += "2011-09-26 13:02:25." + std::to_string(960 + 10 * i) + "000001\n";
            write_image(drive_ + "/image_00/data/" + number + ".png",
                        noise_image(1242, 375, CV_8UC1, static_cast<unsigned>(i)));
            write(drive_ + "/oxts/data/" + number + ".txt", packet(i));
        }
        write(drive_ + "/image_00/timestamps.txt", image_stamps);
        write(drive_ + "/oxts/timestamps.txt", oxts_stamps);
        write(drive_ + "/oxts/dataformat.txt", kDataFormat);
    }
    // Northwards by 1e-5 degrees a packet, heading north.
    static std::string packet(int i) {
        return format(49.015 + 1e-5 * i) +
               " 8.434 116.4 0.03 0.01 1.5707963267948966 9 0 9 0 0 0.5 0.1 9.8 -0.6 -0.2 9.9 "
               "0.01 -0.02 0.03 0.011 0.021 0.031 0.05 0.02 4 11 " +
               std::to_string(i == 0 ? 5 : 6) + " 6 6\n";
    }
    ImportReport run() { return import_kitti(folder_ / drive_, out()); }
};

TEST_F(Kitti, CameraOxtsAndTruthArrive) {
    const auto report = run();
    EXPECT_EQ(report.images, kCount);
    EXPECT_EQ(report.imu_readings, kCount);
    EXPECT_EQ(report.gps_fixes, kCount);
    EXPECT_EQ(report.left_out.total(), 0);
    // `date -u -d "2011-09-26 13:02:25" +%s` prints 1317042145.
    EXPECT_EQ(report.first, 1317042145960000001);
    const auto imu = read_all<ImuReading>(out());
    EXPECT_EQ(imu[0].gyro, Eigen::Vector3d(0.01, -0.02, 0.03));
    EXPECT_EQ(imu[0].accel, Eigen::Vector3d(0.5, 0.1, 9.8));
    const auto gps = read_all<GpsMessage>(out());
    EXPECT_EQ(gps[1].latitude_deg, 49.015 + 1e-5);
    EXPECT_EQ(gps[0].fix_quality, 5);
    EXPECT_EQ(gps[1].fix_quality, 4);

    const auto truth = read_trajectory(report.truth_file);
    ASSERT_EQ(truth.size(), static_cast<size_t>(kCount));
    EXPECT_EQ(truth[0].T_W_B.p, Eigen::Vector3d::Zero());
    // A degree of latitude is 111.2 km there: north is W's y.
    EXPECT_NEAR(truth[3].T_W_B.p.y(), 3e-5 * 111.2e3, 0.01);
    EXPECT_NEAR(truth[3].T_W_B.p.x(), 0, 1e-6);
    // Yaw of 90 degrees: x forward points north.
    EXPECT_NEAR(truth[0].T_W_B.R(1, 0), 1, 2e-3);
}

TEST_F(Kitti, RectifiedCameraStandsWhereTheFilesSay) {
    run();
    const Rig rig = Recording(out()).rig();
    const auto& p = dynamic_cast<const PerspectiveCamera&>(*rig.camera).parameters();
    EXPECT_EQ(p.fx, 721.5377);
    EXPECT_EQ(p.cy, 172.8540);
    EXPECT_EQ(p.distortion, (std::array<double, 8>{}));
    // x_image ~ P_rect_00 R_rect_00 [velo_to_cam] [imu_to_velo] x_B, multiplied out by hand for
    // x_B = (10, 1, 0.5).
    const Eigen::Vector3d p_V(10 - 0.81, 1 + 0.32, 0.5 - 0.80);
    const Eigen::Vector3d p_C0(-p_V.y() - 0.004, -p_V.z() - 0.076, p_V.x() - 0.272);
    Eigen::Matrix3d R_rect;
    R_rect << 9.999239e-01, 9.837760e-03, -7.445048e-03, -9.869795e-03, 9.999421e-01, -4.278459e-03,
        7.402527e-03, 4.351614e-03, 9.999631e-01;
    const Eigen::Vector3d p_rect = R_rect * p_C0;
    const Eigen::Vector3d found = rig.T_B_C.inverse() * Eigen::Vector3d(10, 1, 0.5);
    EXPECT_LT((found - p_rect).norm(), 1e-5);  // R_rect is orthogonal to seven digits
    // Noise of the preset for tactical units.
    Rig preset;
    load_calibration(VIO_SOURCE_DIR "/share/imu/tactical.ini", preset);
    EXPECT_EQ(rig.imu_noise.gyro_noise_density, preset.imu_noise.gyro_noise_density);
    EXPECT_EQ(rig.imu_noise.accel_noise_density, preset.imu_noise.accel_noise_density);
    EXPECT_EQ(rig.imu_noise.gyro_bias_random_walk, preset.imu_noise.gyro_bias_random_walk);
    EXPECT_EQ(rig.imu_noise.accel_bias_random_walk, preset.imu_noise.accel_bias_random_walk);
}

TEST_F(Kitti, TheOtherCameraStandsABaselineToTheRight) {
    run();
    const Pose T_B_C0 = Recording(out()).rig().T_B_C;
    fs::rename(folder_ / (drive_ + "/image_00"), folder_ / (drive_ + "/image_01"));
    KittiImportOptions options;
    options.camera = "image_01";
    import_kitti(folder_ / drive_, out(), options);
    const Pose T_B_C1 = Recording(out()).rig().T_B_C;
    // P_rect_01's fourth column over its focal length: 387.5744 / 721.5377 = 0.53715 m.
    const Eigen::Vector3d place = T_B_C0.inverse() * T_B_C1.p;
    EXPECT_LT((place - Eigen::Vector3d(0.53715, 0, 0)).norm(), 1e-5) << place.transpose();
}

TEST_F(Kitti, ImagesOfTheOriginalSizeHaveTheOriginalCamera) {
    for (int i = 0; i < kCount; ++i)
        write_image(drive_ + "/image_00/data/000000000" + std::to_string(i) + ".png",
                    noise_image(1392, 512, CV_8UC1, 1));
    run();
    const Rig rig = Recording(out()).rig();
    const auto& p = dynamic_cast<const PerspectiveCamera&>(*rig.camera).parameters();
    EXPECT_EQ(p.fy, 980.8141);
    EXPECT_EQ(p.distortion[4], -7.233722e-02);
    // Without R_rect, the camera sees forwards (B's x) along its z to the file's digits.
    EXPECT_LT((rig.T_B_C.R.col(2) - Eigen::Vector3d::UnitX()).norm(), 1e-9);
}

TEST_F(Kitti, StampsThatStepBackAreLeftOutAndCounted) {
    write(drive_ + "/oxts/timestamps.txt",
          "2011-09-26 13:02:25.960\n2011-09-26 13:02:25.980\n2011-09-26 13:02:25.970\n"
          "2011-09-26 13:02:25.990\n");
    const auto report = run();
    EXPECT_EQ(report.left_out.total(), 1);
    EXPECT_EQ(report.imu_readings, kCount - 1);
}

TEST_F(Kitti, WhatIsWrongIsNamed) {
    const auto with = [&](const std::string& name, const std::string& text) {
        const std::string file = folder_ / name, good = read_text(file);
        write_text(file, text);
        const std::string message = refusal([&] { run(); });
        write_text(file, good);
        return message;
    };
    const std::string stamps = with(drive_ + "/oxts/timestamps.txt", "2011-13-26 13:02:25.9\n");
    EXPECT_TRUE(contains(stamps, "oxts/timestamps.txt (line 1)")) << stamps;
    const std::string few = with(drive_ + "/oxts/data/0000000002.txt", "49 8 100 0 0 0\n");
    EXPECT_TRUE(contains(few, "0000000002.txt (line 1)")) << few;
    const std::string word = with(drive_ + "/oxts/data/0000000001.txt", "x" + packet(1));
    EXPECT_TRUE(contains(word, "0000000001.txt (line 1)")) << word;
    const std::string format = with(drive_ + "/oxts/dataformat.txt", "lat: latitude\n");
    EXPECT_TRUE(contains(format, "dataformat.txt: names no value 'lon'")) << format;
    const std::string key = with("2011_09_26/calib_velo_to_cam.txt", "R: 0 -1 0 0 0 -1 1 0 0\n");
    EXPECT_TRUE(contains(key, "calib_velo_to_cam.txt (T): is missing")) << key;
    const std::string turn =
        with("2011_09_26/calib_imu_to_velo.txt", "R: 2 0 0 0 1 0 0 0 1\nT: 0 0 0\n");
    EXPECT_TRUE(contains(turn, "(R): is no rotation")) << turn;
    std::string other = kCamToCam;
    other.replace(other.find("1.242000e+03"), 12, "1.240000e+03");
    const std::string size = with("2011_09_26/calib_cam_to_cam.txt", other);
    EXPECT_TRUE(contains(size, "is not the size of the images, 1242x375 px")) << size;
    fs::remove(folder_ / "2011_09_26/calib_cam_to_cam.txt");
    const std::string none = refusal([&] { run(); });
    EXPECT_TRUE(contains(none, "--calibration-dir")) << none;
}

TEST_F(Kitti, ImagesAndPacketsThatCannotBeUsedAreLeftOut) {
    const auto whole = run();
    fs::remove(folder_ / (drive_ + "/image_00/data/0000000003.png"));
    std::string unknown = packet(1);
    unknown.replace(0, unknown.find(' '), "nan");
    write(drive_ + "/oxts/data/0000000001.txt", unknown);
    const auto report = run();
    EXPECT_EQ(report.images, whole.images - 1);
    EXPECT_EQ(report.imu_readings, whole.imu_readings - 1);
    ASSERT_EQ(report.left_out.kinds().size(), whole.left_out.kinds().size() + 2);
    std::string told;
    for (const LeftOut& kind : report.left_out.kinds()) told += one_line(kind) + "\n";
    EXPECT_TRUE(contains(told, "timestamps.txt (line 4): image")) << told;
    EXPECT_TRUE(contains(told, "1 OXTS packets: ") && contains(told, "0000000001.txt (line 1)"))
        << told;
}

TEST(DateTime, IsParsedExactly) {
    EXPECT_EQ(parse_date_time("1970-01-01 00:00:00.000000001"), 1);
    EXPECT_EQ(parse_date_time("2012-02-29 23:59:59"), 1330559999000000000);
    for (const char* bad :
         {"", "2011-02-29 00:00:00", "2011-09-26T13:02:25.9", "2011-09-26 24:00:00",
          "2011-09-26 13:60:00", "2011-09-26 13:02:61.0", "2011-09-26 13:02:-1.0",
          "1005-09-26 13:02:25.1", "2116-01-01 00:00:00"})
        EXPECT_EQ(parse_date_time(bad), std::nullopt) << bad;
}

// --- Tables

class Csv : public Import {
 protected:
    void SetUp() override {
        // As a phone's logger writes them: names in quotes, an order of its own, ms.
        write("gyro.csv",
              "\"time (ms)\",\"z\",\"y\",\"x\"\n1000.5,30,20,10\n1010.5,31,21,11\n"
              "1010.5,31,21,11\n1020.5,32,22,12\n1100,0,0,0\n");
        write("accel.csv", "t,ax,ay,az\n995.5,0,0,-1\n1015.5,0.2,0,-1\n1035.5,0.4,0,-1\n");
        options_.gyro = {folder_ / "gyro.csv", {"time (ms)", "x", "y", "z"}, "ms"};
        options_.accel = {folder_ / "accel.csv", {"t", "ax", "ay", "az"}, "ms"};
        options_.gyro_unit = kDegree;
        options_.accel_unit = -9.80665;
    }
    ImportReport run() { return import_csv(out(), options_); }

    CsvImportOptions options_;
};

TEST_F(Csv, UnitsOrderAndSeparateStampsAreMet) {
    const auto report = run();
    // One repeated row, and one after the accelerometer's last.
    EXPECT_EQ(report.left_out.total(), 2);
    const auto imu = read_all<ImuReading>(out());
    ASSERT_EQ(imu.size(), 3u);
    EXPECT_EQ(imu[0].t, 1000500000);
    EXPECT_LT((imu[1].gyro - Eigen::Vector3d(11, 21, 31) * kDegree).norm(), 1e-12);
    // A quarter, three quarters of 20 ms; the next interval's first quarter.
    EXPECT_NEAR(imu[0].accel.x(), -9.80665 * 0.05, 1e-12);
    EXPECT_NEAR(imu[1].accel.x(), -9.80665 * 0.15, 1e-12);
    EXPECT_NEAR(imu[2].accel.x(), -9.80665 * 0.25, 1e-12);
    EXPECT_NEAR(imu[0].accel.z(), 9.80665, 1e-12);
}

// A value that is not finite, or none at all, costs its own row and no other.
TEST_F(Csv, ReadingsWithoutANumberAreLeftOutAndTold) {
    write("imu.csv",
          "1,1,1,1,0,0,9\n2,1,nan,1,0,0,9\n3,1,1,1,0,0,9\n4,1,1,1,,0,9\n5,1,1,1,0,0,9\n");
    options_ = {};
    options_.gyro = {folder_ / "imu.csv", {"1", "2", "3", "4", "5", "6", "7"}, "s"};
    const auto report = run();
    EXPECT_EQ(report.imu_readings, 3);
    ASSERT_EQ(report.left_out.kinds().size(), 1u);
    EXPECT_EQ(report.left_out.total(), 2);
    EXPECT_EQ(report.left_out.kinds()[0].first,
              (folder_ / "imu.csv") + " (line 2): 'nan' is not a finite number");
    EXPECT_EQ(read_all<ImuReading>(out()).size(), 3u);

    // The accelerometer is interpolated over the row that is gone.
    write("gyro.csv", "0.02,1,1,1\n");
    write("accel.csv", "0,0,0,1\n0.01,inf,0,2\n0.04,0,0,5\n");
    options_.gyro = {folder_ / "gyro.csv", {"1", "2", "3", "4"}, "s"};
    options_.accel = {folder_ / "accel.csv", {"1", "2", "3", "4"}, "s"};
    EXPECT_EQ(run().left_out.total(), 1);
    EXPECT_NEAR(read_all<ImuReading>(out()).at(0).accel.z(), 3, 1e-12);
}

TEST_F(Csv, GapsOfTheAccelerometerAreNotBridged) {
    write("accel.csv", "995.5,0,0,1\n1005.5,0,0,1\n1205.5,0,0,1\n");
    options_.accel.columns = {"1", "2", "3", "4"};
    const auto report = run();
    EXPECT_EQ(report.imu_readings, 1);
    EXPECT_EQ(report.left_out.total(), 4);
}

TEST_F(Csv, ImagesByNameOrInOrder) {
    for (const char* name : {"frames/a.png", "frames/b.png"})
        write_image(name, noise_image(64, 48, CV_8UC1, 1));
    write("frames/list.csv", "1000000000 b.png\n1500000000 a.png\n");
    write("stamps.txt", "1.0\n1.5\n");
    write("calibration.ini",
          "[camera]\nmodel = perspective\nwidth = 64\nheight = 48\nfx = 50\nfy = 50\ncx = 31.5\n"
          "cy = 23.5\n");
    write("imu.ini", "[imu]\ngyro_noise_density = 0.001\n");
    options_ = {};
    options_.images = {folder_ / "frames/list.csv", {"1", "2"}, "ns"};
    options_.calibration_files = {folder_ / "calibration.ini", folder_ / "imu.ini"};
    EXPECT_EQ(run().images, 2);
    const Recording recording(out());
    EXPECT_TRUE(recording.rig().camera);
    EXPECT_EQ(recording.rig().imu_noise.gyro_noise_density, 0.001);
    EXPECT_EQ(read_all<ImageMessage>(out())[1].t, 1500000000);

    options_.images = {folder_ / "stamps.txt", {"1"}, "s"};
    fs::remove(folder_ / "frames/list.csv");
    options_.images_dir = folder_ / "frames";
    EXPECT_EQ(run().images, 2);
    write("stamps.txt", "1.0\n");
    fs::remove(out());
    const std::string count = refusal([&] { run(); });
    EXPECT_TRUE(contains(count, "1 stamps for 2 files")) << count;
}

TEST_F(Csv, TimeUnitsAreTakenExactly) {
    const std::pair<const char*, const char*> cases[] = {{"s", "1403636584.763555584"},
                                                         {"ms", "1403636584763.555584"},
                                                         {"us", "1403636584763555.584"},
                                                         {"ns", "1403636584763555584"}};
    for (const auto& [unit, text] : cases) {
        write("imu.csv", std::string(text) + ",1,2,3,4,5,6\n");
        CsvImportOptions options;
        options.gyro = {folder_ / "imu.csv", {"1", "2", "3", "4", "5", "6", "7"}, unit};
        EXPECT_EQ(import_csv(out(), options).first, 1403636584763555584) << unit;
    }
}

TEST_F(Csv, WhatIsWrongIsNamed) {
    options_.gyro.columns[1] = "gx";
    std::string message = refusal([&] { run(); });
    EXPECT_TRUE(contains(message, "no column 'gx'; it has time (ms), z, y, x")) << message;
    options_.gyro.columns = {"1", "2", "3", "9"};
    message = refusal([&] { run(); });
    EXPECT_TRUE(contains(message, "gyro.csv (line 2)")) << message;
    options_.gyro.columns = {"1", "2", "3"};
    message = refusal([&] { run(); });
    EXPECT_TRUE(contains(message, "3 columns are named")) << message;
    options_.gyro.columns = {"1", "2", "3", "4"};
    write("gyro.csv", "t,x,y,z\n2,1,1,1\n1,1,1,1\n");
    message = refusal([&] { run(); });
    // Before the accelerometer begins: read, judged and refused all the same.
    EXPECT_TRUE(contains(message, "gyro.csv (line 3)")) << message;
    write("gyro.csv", "t,x,y,z\n1000.5,1,nan,1\n");
    message = refusal([&] { run(); });
    EXPECT_TRUE(contains(message, "'nan' is not a finite number")) << message;
    options_.gyro.file = folder_ / "none.csv";
    message = refusal([&] { run(); });
    EXPECT_TRUE(contains(message, "none.csv: no such file")) << message;
    options_ = {};
    EXPECT_TRUE(contains(refusal([&] { run(); }), "neither images nor IMU"));
}

// --- Export to ASL and back

Rig fisheye_rig() {
    Rig rig;
    rig.camera = std::make_shared<FisheyeCamera>(
        FisheyeParameters{64, 48, 20.1, 20.2, 31.3, 23.4, {0.1, -0.02, 0.003, -0.0004}});
    rig.T_B_C = {so3::exp({0.3, -1.2, 0.7}), {0.1, -0.2, 1 / 3.0}};
    rig.T_B_I = {so3::exp({-0.1, 0.2, 2.0}), {1e-3, 0.5, -0.04}};
    rig.imu_noise = {1.1e-3, 2.2e-2, 3.3e-5, 4.4e-3, 0.005};
    rig.time_offset = -0.0123;
    return rig;
}

class AslRoundTrip : public Import {
 protected:
    void write_recording(const Rig& rig, bool odometry = false) {
        RawlogWriter writer(folder_ / "in.rawlog", rig);
        for (int i = 0; i < 20; ++i) {
            const TimeNs t = 1403636584763555500 + i * 5000100;
            writer.write(ImuReading{t, {0.1 * i, 1 / 3.0, -2e-7}, {9.8, 1.0 / (i + 1), 1e-9}});
            if (i % 4 == 0)
                writer.write(
                    ImageMessage{t, noise_image(64, 48, CV_8UC1, static_cast<unsigned>(i))});
            if (i % 4 == 0)
                writer.write(FeatureFrame{t, {{i, {1.0 / 3, 2.0 + i}}, {i + 1, {3.25, 47.9}}}});
            if (i % 10 == 7) writer.write(FeatureFrame{t, {}});  // nothing was seen
            if (odometry && i % 10 == 0) writer.write(OdometryMessage{t, {}});
        }
        writer.finish();
        write_tum(folder_ / "in.truth.tum",
                  {{1403636584763555584, {so3::exp({1, 2, 0.5}), {1, 2, 3}}}}, "T_W_B");
    }
};

TEST_F(AslRoundTrip, GivesTheSameRawlogAgain) {
    const Rig rig = fisheye_rig();
    write_recording(rig);
    const auto exported = export_asl(folder_ / "in.rawlog", folder_ / "asl");
    EXPECT_EQ(exported.images, 5);
    EXPECT_EQ(exported.feature_frames, 7);
    EXPECT_EQ(exported.imu_readings, 20);
    EXPECT_EQ(exported.left_out, 0);
    import_asl(folder_ / "asl", out());

    Recording a(folder_ / "in.rawlog"), b(out());
    for (int i = 0; i < 32; ++i) {
        const auto left = a.next(), right = b.next();
        ASSERT_TRUE(left && right) << i;
        ASSERT_EQ(left->index(), right->index()) << i;
        if (const auto* r = std::get_if<ImuReading>(&*left)) {
            const auto& other = std::get<ImuReading>(*right);
            EXPECT_EQ(r->t, other.t);
            EXPECT_EQ(r->gyro, other.gyro);
            EXPECT_EQ(r->accel, other.accel);
        } else if (const auto* m = std::get_if<ImageMessage>(&*left)) {
            const auto& other = std::get<ImageMessage>(*right);
            EXPECT_EQ(m->t, other.t);
            EXPECT_EQ(cv::norm(m->image, other.image, cv::NORM_INF), 0);
        } else {
            const auto& frame = std::get<FeatureFrame>(*left);
            const auto& other = std::get<FeatureFrame>(*right);
            EXPECT_EQ(frame.t, other.t);
            ASSERT_EQ(frame.features.size(), other.features.size());
            if (frame.features.empty()) continue;
            EXPECT_EQ(frame.features[0].uv_px, other.features[0].uv_px);
            EXPECT_EQ(frame.features[1].feature_id, other.features[1].feature_id);
        }
    }
    EXPECT_FALSE(a.next() || b.next());

    const Rig again = b.rig();
    EXPECT_LT(again.T_B_C.boxminus(rig.T_B_C).norm(), 1e-14);
    EXPECT_LT(again.T_B_I.boxminus(rig.T_B_I).norm(), 1e-14);
    EXPECT_EQ(again.time_offset, rig.time_offset);
    EXPECT_EQ(again.imu_noise.gyro_bias_random_walk, 3.3e-5);
    EXPECT_EQ(again.imu_noise.gyro_sensitivity_error, 0.005);
    EXPECT_EQ(dynamic_cast<const FisheyeCamera&>(*again.camera).parameters().k,
              dynamic_cast<const FisheyeCamera&>(*rig.camera).parameters().k);
    const auto truth = read_trajectory(folder_ / "out.truth.tum");
    ASSERT_EQ(truth.size(), 1u);
    EXPECT_EQ(truth[0].t, 1403636584763555584);
    EXPECT_LT((truth[0].T_W_B.R - so3::exp({1, 2, 0.5})).norm(), 1e-14);
}

TEST_F(AslRoundTrip, WhatCannotBeExportedIsSaid) {
    write_recording(fisheye_rig(), true);
    EXPECT_EQ(export_asl(folder_ / "in.rawlog", folder_ / "asl").left_out, 2);
    std::string message = error_of([&] { export_asl(folder_ / "in.rawlog", folder_ / "asl"); });
    EXPECT_TRUE(contains(message, "exists already")) << message;
    Rig rig = fisheye_rig();
    auto limited = dynamic_cast<const FisheyeCamera&>(*rig.camera).parameters();
    limited.max_angle = 1.5;
    rig.camera = std::make_shared<FisheyeCamera>(limited);
    write_recording(rig);
    message = error_of([&] { export_asl(folder_ / "in.rawlog", folder_ / "other"); });
    EXPECT_TRUE(contains(message, "no form in ASL's sensor.yaml")) << message;
    EXPECT_FALSE(fs::exists(folder_ / "other/mav0"));
    EXPECT_FALSE(fs::exists(folder_ / "other/mav0.partial"));
    rig.camera.reset();
    write_recording(rig);
    message = error_of([&] { export_asl(folder_ / "in.rawlog", folder_ / "other"); });
    EXPECT_TRUE(contains(message, "--calibration")) << message;
}

}  // namespace
}  // namespace vio
