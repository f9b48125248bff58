// Calibration files of every kind, and cameras of every model through files and rawlogs.
#include <gtest/gtest.h>
#include <mrpt/img/TCamera.h>

#include <filesystem>

#include "libvio/base/errors.h"
#include "libvio/calibration/board_file.h"
#include "libvio/camera/description.h"
#include "libvio/io/calibration_file.h"
#include "libvio/io/rawlog_writer.h"
#include "libvio/io/text.h"
#include "tests/unit/scratch_folder.h"

namespace vio {
namespace {

using test::ScratchFolder;

CameraDescription described(const std::string& model) {
    CameraDescription d;
    d.model = model;
    d.lens = {640, 480, 2162.25, 2161.5, 319.1, 240.7, {}};
    if (model == "perspective")
        d.lens.distortion = {-0.28340811, 0.07395907, 1.9359e-4, 1.7e-05, 0.01, 0.02, 0.03, 0.04};
    if (model == "fisheye") {
        d.lens.fx = d.lens.fy = 190.978;
        d.lens.distortion = {3.4e-3, 7.1e-4, -2.0e-3, 2.0e-4};
        d.max_angle = 1.7;
    }
    if (model == "unified") {
        d.lens.fx = d.lens.fy = 400;
        d.xi = 0.9;
        d.mirror = true;
        d.min_angle = 0.2;
        d.max_angle = 1.8;
    }
    if (!is_mirror_model(model)) return d;
    using Kind = MirrorShapeParameters::Kind;
    d.shape.kind = model == "equiangular_mirror"  ? Kind::kEquiangular
                   : model == "hyperbolic_mirror" ? Kind::kHyperbolic
                                                  : Kind::kParabolic;
    if (model == "parabolic_mirror") d.lens.fx = d.lens.fy = 12000;
    d.shape.apex_distance = 0.15;
    if (model == "equiangular_mirror") d.shape.gain = 17;
    if (model == "hyperbolic_mirror") d.shape.eccentricity = 1.25;
    if (model == "parabolic_mirror") d.shape.semi_latus_rectum = 0.02;
    d.shape.rim_radius = 0.0166;
    d.shape.blind_radius = 0.003;
    d.T_C_M = {so3::exp({0.02, -0.015, 0.1}), {0.001, -0.0015, 0.003}};
    return d;
}

Rig rig_with(const std::string& model) {
    Rig rig;
    rig.camera = make_camera(described(model));
    rig.T_B_C = {so3::exp({0.3, -1.4, 2.2}), {-0.021, -0.064, 0.0098}};
    rig.T_B_I = {so3::exp({-2.9, 0.2, 0.4}), {0.1, 1.0 / 3, -0.7}};
    rig.time_offset = -0.0123;
    return rig;
}

void expect_same(const Camera& a, const Camera& b) {
    const CameraDescription x = describe(a), y = describe(b);
    EXPECT_EQ(x.model, y.model);
    EXPECT_EQ(x.lens.width, y.lens.width);
    EXPECT_EQ(x.lens.fx, y.lens.fx);
    EXPECT_EQ(x.lens.cy, y.lens.cy);
    EXPECT_EQ(x.lens.distortion, y.lens.distortion);
    EXPECT_EQ(x.max_angle, y.max_angle);
    EXPECT_EQ(x.min_angle, y.min_angle);
    EXPECT_EQ(x.xi, y.xi);
    EXPECT_EQ(x.mirror, y.mirror);
    EXPECT_EQ(x.shape.kind, y.shape.kind);
    EXPECT_EQ(x.shape.gain, y.shape.gain);
    EXPECT_EQ(x.shape.eccentricity, y.shape.eccentricity);
    EXPECT_EQ(x.shape.semi_latus_rectum, y.shape.semi_latus_rectum);
    EXPECT_EQ(x.shape.apex_distance, y.shape.apex_distance);
    EXPECT_EQ(x.shape.rim_radius, y.shape.rim_radius);
    EXPECT_EQ(x.shape.blind_radius, y.shape.blind_radius);
    EXPECT_LT(x.T_C_M.boxminus(y.T_C_M).norm(), 1e-15);
}

std::string reading_error(const std::string& file, Rig rig = {}) {
    return test::error_of([&] { load_calibration(file, rig); });
}

class EveryModel : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryModel, SurvivesACalibrationFile) {
    ScratchFolder folder;
    const Rig rig = rig_with(GetParam());
    write_text(folder / "c.ini", calibration_text(rig));
    Rig read;
    load_calibration(folder / "c.ini", read);
    ASSERT_TRUE(read.camera);
    expect_same(*read.camera, *rig.camera);
    EXPECT_LT(read.T_B_C.boxminus(rig.T_B_C).norm(), 1e-15);
    EXPECT_LT(read.T_B_I.boxminus(rig.T_B_I).norm(), 1e-15);
    EXPECT_EQ(read.time_offset, rig.time_offset);
}

TEST_P(EveryModel, TravelsWithARawlog) {
    ScratchFolder folder;
    const Rig rig = rig_with(GetParam());
    RawlogWriter writer(folder / "a.rawlog", rig);
    for (int i = 0; i < 3; ++i)
        writer.write(
            FeatureFrame{i * 100'000'000LL, {{1, {300, 200}, Eigen::Matrix2d::Identity()}}});
    writer.finish();
    const Recording recording(folder / "a.rawlog");
    ASSERT_TRUE(recording.rig().camera);
    expect_same(*recording.rig().camera, *rig.camera);
    EXPECT_LT(recording.rig().T_B_C.boxminus(rig.T_B_C).norm(), 1e-14);
}

TEST_P(EveryModel, NeedsAllItsKeysWhereNoCameraIsKnown) {
    ScratchFolder folder;
    write_text(folder / "c.ini", "[camera]\nmodel = " + GetParam() + "\nfx = 100\n");
    EXPECT_NE(reading_error(folder / "c.ini").find("width is missing"), std::string::npos);
}

INSTANTIATE_TEST_SUITE_P(Models, EveryModel, ::testing::ValuesIn(camera_models()),
                         [](const auto& model) { return model.param; });

TEST(Calibration, MirrorCameraWithoutItsFileIsAClearError) {
    ScratchFolder folder;
    RawlogWriter writer(folder / "a.rawlog", rig_with("equiangular_mirror"));
    for (int i = 0; i < 3; ++i) writer.write(FeatureFrame{i * 100'000'000LL, {}});
    writer.finish();
    std::filesystem::remove(folder / "a.calibration.ini");
    const std::string message = test::error_of([&] { Recording(folder / "a.rawlog"); });
    EXPECT_NE(message.find("equiangular_mirror"), std::string::npos) << message;
    EXPECT_NE(message.find("a.calibration.ini"), std::string::npos) << message;
}

TEST(Calibration, KeysOfAnotherModelAreRefused) {
    ScratchFolder folder;
    write_text(folder / "c.ini", "[camera]\nxi = 0.9\n");
    EXPECT_NE(reading_error(folder / "c.ini", rig_with("perspective")).find("no such key"),
              std::string::npos);
    write_text(folder / "c.ini", "[camera]\nmodel = pinhole\n");
    EXPECT_NE(reading_error(folder / "c.ini").find("no camera model"), std::string::npos);
    write_text(folder / "c.ini", "[camera]\ngain = 0.5\n");
    EXPECT_NE(reading_error(folder / "c.ini", rig_with("equiangular_mirror")).find("gain"),
              std::string::npos);
}

TEST(Calibration, OneKeyOfAMirrorMayBeOverridden) {
    ScratchFolder folder;
    write_text(folder / "c.ini", "[camera]\nT_C_M = 0 0.001 0 0 0 0 1\n");
    Rig rig = rig_with("equiangular_mirror");
    load_calibration(folder / "c.ini", rig);
    const CameraDescription d = describe(*rig.camera);
    EXPECT_EQ(d.T_C_M.p, Eigen::Vector3d(0, 0.001, 0));
    EXPECT_EQ(d.shape.gain, 17);
}

TEST(Calibration, ReadsMrptsOwnFiles) {
    ScratchFolder folder;
    mrpt::img::TCamera camera;
    camera.ncols = 640;
    camera.nrows = 480;
    camera.setIntrinsicParamsFromValues(500, 501, 320, 240);
    camera.setDistortionKannalaBrandt(0.01, 0.02, -0.03, 0.04);
    write_text(folder / "fisheye.ini", "[CAMERA_PARAMS]\n" + camera.dumpAsText());
    camera.setDistortionPlumbBob(0.1, 0.2, 0.3, 0.4, 0.5);
    write_text(folder / "plumb.ini", "[CAMERA_PARAMS]\n" + camera.dumpAsText());
    Rig rig;
    load_calibration(folder / "fisheye.ini", rig);
    CameraDescription d = describe(*rig.camera);
    EXPECT_EQ(d.model, "fisheye");
    EXPECT_EQ(d.lens.fy, 501);
    EXPECT_EQ(d.lens.distortion, (std::array<double, 8>{0.01, 0.02, -0.03, 0.04}));
    load_calibration(folder / "plumb.ini", rig);
    d = describe(*rig.camera);
    EXPECT_EQ(d.model, "perspective");
    EXPECT_EQ(d.lens.distortion[4], 0.5);
    EXPECT_EQ(d.lens.width, 640);
    for (const char* size : {"[1e11 480]", "[640 -480]", "[640.5 480]"}) {
        write_text(folder / "size.ini", std::string("[CAMERA_PARAMS]\nresolution = ") + size +
                                            "\nfx = 500\nfy = 500\ncx = 320\ncy = 240\n");
        const std::string error =
            test::error_of([&] { load_calibration(folder / "size.ini", rig); });
        EXPECT_NE(error.find("whole number of pixels"), std::string::npos) << size << error;
    }
}

TEST(Calibration, SurveyedPointsAreAsSureAsTheirRowsSay) {
    ScratchFolder folder;
    const std::string file = folder / "survey.csv";
    write_text(file, "#id,x,y,z,sigma\n3,1,2,3\n4,4,5,6,0.002\n5,7,8,9,0\n");
    const auto points = read_fiducials(file);
    ASSERT_EQ(points.size(), 3u);
    EXPECT_EQ(points.at(4).p_W, Eigen::Vector3d(4, 5, 6));
    EXPECT_TRUE(points.at(3).covariance.isZero(0));
    EXPECT_TRUE(points.at(4).covariance.isApprox(4e-6 * Eigen::Matrix3d::Identity()));
    EXPECT_TRUE(points.at(5).covariance.isZero(0));
    EXPECT_EQ(read_board(file).points.at(4).covariance, points.at(4).covariance);

    const auto says = [&](const std::string& rows, const std::string& words) {
        write_text(file, rows);
        const std::string error = test::error_of([&] { read_fiducials(file); });
        EXPECT_NE(error.find(words), std::string::npos) << error;
        EXPECT_NE(error.find(file), std::string::npos) << error;
    };
    says("3,1,2,3,-0.1\n", "(line 1): sigma is negative");
    says("3,1,2,3\n4,1,2,3,nan\n", "(line 2): 'nan' is not a finite number");
    says("3,1,2,3,inf\n", "'inf' is not a finite number");
    says("# nothing\n", "feature_id,x,y,z[,sigma]");
}

// T_cam_imu places the camera on the IMU, wherever the other file has put the IMU, before or after.
TEST(Calibration, OrderOfFilesDoesNotMoveTheCamera) {
    ScratchFolder folder;
    write_text(folder / "camchain.yaml",
               "cam0:\n  T_cam_imu:\n  - [1, 0, 0, 0.1]\n  - [0, 1, 0, 0]\n  - [0, 0, 1, 0]\n"
               "  - [0, 0, 0, 1]\n  camera_model: pinhole\n  distortion_coeffs: [0, 0, 0, 0]\n"
               "  distortion_model: radtan\n  intrinsics: [400, 400, 320, 240]\n"
               "  resolution: [640, 480]\n");
    write_text(folder / "imu.ini", "[imu]\nT_B_I = 1.04 -0.03 0.03 0 0 1 0\n");
    write_text(folder / "imu.yaml",
               "T_BS:\n  data: [0, -1, 0, 0.5, 1, 0, 0, 0.6, 0, 0, 1, 0.7, 0, 0, 0, 1]\n"
               "accelerometer_noise_density: 0.0014\naccelerometer_random_walk: 8.6e-05\n"
               "gyroscope_noise_density: 8.0e-05\ngyroscope_random_walk: 2.2e-06\n");
    Rig recorded;  // the rawlog's own, to be overridden
    recorded.T_B_I = recorded.T_B_C = {Eigen::Matrix3d::Identity(), {7, 8, 9}};
    for (const char* imu : {"imu.ini", "imu.yaml"}) {
        Rig before = recorded, after = recorded, imu_alone = recorded;
        load_calibrations({folder / imu, folder / "camchain.yaml"}, before);
        load_calibrations({folder / "camchain.yaml", folder / imu}, after);
        load_calibration(folder / imu, imu_alone);
        for (const Rig& rig : {before, after}) {
            EXPECT_EQ(rig.T_B_I.p, imu_alone.T_B_I.p);
            EXPECT_LT((rig.T_I_C().p - Eigen::Vector3d(-0.1, 0, 0)).norm(), 1e-15) << imu;
            EXPECT_LT((rig.T_I_C().R - Eigen::Matrix3d::Identity()).norm(), 1e-15) << imu;
        }
        EXPECT_EQ(before.T_B_C.p, after.T_B_C.p);
        EXPECT_EQ(imu_alone.T_B_C.p, recorded.T_B_C.p);  // of which that file says nothing
    }
    // Of two that say where the camera is, the later one.
    write_text(folder / "camera.ini", "[camera]\nT_B_C = 1 2 3 0 0 0 1\n");
    Rig rig;
    load_calibrations({folder / "camchain.yaml", folder / "camera.ini", folder / "imu.ini"}, rig);
    EXPECT_EQ(rig.T_B_C.p, Eigen::Vector3d(1, 2, 3));
    load_calibrations({folder / "camera.ini", folder / "camchain.yaml", folder / "imu.ini"}, rig);
    EXPECT_LT((rig.T_I_C().p - Eigen::Vector3d(-0.1, 0, 0)).norm(), 1e-15);
}

TEST(Calibration, ReadsKalibrsFiles) {
    ScratchFolder folder;
    write_text(folder / "camchain.yaml",
               "cam0:\n"
               "  T_cam_imu:\n"
               "  - [0.0, -1.0, 0.0, 0.1]\n"
               "  - [1.0, 0.0, 0.0, 0.2]\n"
               "  - [0.0, 0.0, 1.0, 0.3]\n"
               "  - [0.0, 0.0, 0.0, 1.0]\n"
               "  camera_model: pinhole\n"
               "  distortion_coeffs: [0.0034, 0.0007, -0.002, 0.0002]\n"
               "  distortion_model: equidistant\n"
               "  intrinsics: [190.978, 190.973, 254.931, 256.897]\n"
               "  resolution: [512, 512]\n"
               "  timeshift_cam_imu: -0.0021\n");
    write_text(folder / "imu.yaml",
               "accelerometer_noise_density: 0.0014\naccelerometer_random_walk: 8.6e-05\n"
               "gyroscope_noise_density: 8.0e-05\ngyroscope_random_walk: 2.2e-06\n"
               "rostopic: /imu0\nupdate_rate: 200.0\n");
    Rig rig;
    rig.T_B_I.p = {1, 0, 0};
    load_calibration(folder / "camchain.yaml", rig);
    load_calibration(folder / "imu.yaml", rig);
    const CameraDescription d = describe(*rig.camera);
    EXPECT_EQ(d.model, "fisheye");
    EXPECT_EQ(d.lens.cy, 256.897);
    EXPECT_EQ(d.lens.distortion[2], -0.002);
    // p_cam = T_cam_imu p_imu.
    EXPECT_LT((rig.T_I_C() * Eigen::Vector3d(0.1, 0.2, 0.3)).norm(), 1e-15);
    EXPECT_EQ(rig.time_offset, -0.0021);
    EXPECT_EQ(rig.imu_noise.accel_bias_random_walk, 8.6e-05);

    write_text(folder / "omni.yaml",
               "cam0:\n  camera_model: omni\n  distortion_coeffs: [-0.1, 0.02, 1.0e-4, 0]\n"
               "  distortion_model: radtan\n  intrinsics: [1.3, 800, 801, 320, 240]\n"
               "  resolution: [640, 480]\n");
    load_calibration(folder / "omni.yaml", rig);
    EXPECT_EQ(describe(*rig.camera).xi, 1.3);
    EXPECT_EQ(describe(*rig.camera).lens.fy, 801);

    write_text(folder / "bad.yaml", "cam0:\n  camera_model: ds\n");
    EXPECT_NE(reading_error(folder / "bad.yaml").find("'ds' is not known"), std::string::npos);
    write_text(folder / "other.yaml", "foo: 1\n");
    EXPECT_NE(reading_error(folder / "other.yaml").find("no calibration known"), std::string::npos);
}

}  // namespace
}  // namespace vio
