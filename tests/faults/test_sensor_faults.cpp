// What `vio-slam check` says of recordings whose sensors, calibration or stamps are wrong, and that
// `run` says the same while it works. Each fault is a row of tests/README.md.
#include <gtest/gtest.h>

#include <fstream>
#include <numbers>
#include <random>
#include <regex>

#include "libvio/base/angles.h"
#include "libvio/camera/fisheye.h"
#include "libvio/camera/mirror.h"
#include "libvio/camera/perspective.h"
#include "libvio/check/inertial.h"
#include "tests/draws.h"
#include "tests/faults/recordings.h"

namespace vio::test {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

class SensorFaults : public ::testing::Test {
 protected:
    // `check` gives the line "grade name ... words" and, for an error, fails.
    void expect(const Written& recording, const std::string& grade, const std::string& name,
                const std::string& words) {
        const std::string file = folder_ / "recording.rawlog";
        write(recording, file);
        const ProgramResult result = vio_slam("check " + file, folder_.path().string());
        std::string begin = grade;
        begin.resize(10, ' ');
        const auto line = result.out.find("\n" + begin + name);
        ASSERT_NE(line, std::string::npos) << begin << name << " is not in\n" << result.out;
        const std::string after =
            result.out.substr(line + 1, result.out.find("\n", line + 1 + 400) - line);
        EXPECT_NE(after.find(words), std::string::npos) << words << " is not in\n" << after;
        if (grade == "error")
            EXPECT_EQ(result.exit_code, 1);
        else
            EXPECT_EQ(result.exit_code, 0) << result.out;
    }

    Written good() { return as_written(good_recording()); }

    ScratchFolder folder_;
};

TEST_F(SensorFaults, AGoodRecordingHasNone) {
    write(good(), folder_ / "good.rawlog");
    const ProgramResult result =
        vio_slam("check " + (folder_ / "good.rawlog"), folder_.path().string());
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_NE(result.out.find("0 errors, 0 warnings"), std::string::npos) << result.out;
    EXPECT_EQ(result.err, "");
}

TEST_F(SensorFaults, GyroInDegrees) {
    expect(with_readings(good(), [](ImuReading& r) { r.gyro /= kDegree; }), "error", "gyro scale",
           "in deg/s: multiply it by pi/180");
}

TEST_F(SensorFaults, AccelerometerInG) {
    expect(with_readings(good(), [](ImuReading& r) { r.accel /= 9.80665; }), "error", "gravity",
           "in g: multiply it by 9.80665");
}

TEST_F(SensorFaults, GravityTakenOut) {
    const Simulation& s = good_recording();
    Written recording = good();
    std::size_t i = 0;
    for (Message& message : recording.messages)
        if (auto* reading = std::get_if<ImuReading>(&message)) {
            const TimeNs t = reading->t;
            while (i + 1 < s.truth().size() && s.truth()[i].t < t) ++i;
            reading->accel +=
                s.rig().T_B_I.R.transpose() * s.truth()[i].T_W_B.R.transpose() * s.g_W();
        }
    expect(recording, "error", "gravity", "gravity has been taken out");
}

TEST_F(SensorFaults, GyroAxesExchanged) {
    expect(with_readings(good(), [](ImuReading& r) { std::swap(r.gyro.x(), r.gyro.z()); }), "error",
           "camera-IMU rotation", "mirror image");
}

TEST_F(SensorFaults, GyroAxisNegated) {
    expect(with_readings(good(), [](ImuReading& r) { r.gyro.z() *= -1; }), "error",
           "camera-IMU rotation", "z = -z");
}

TEST_F(SensorFaults, ImuMountedAsNotStated) {
    // x forward, y left in truth; the driver writes y forward, x right.
    expect(with_readings(good(),
                         [](ImuReading& r) {
                             r.gyro = Vector3d(-r.gyro.y(), r.gyro.x(), r.gyro.z());
                             r.accel = Vector3d(-r.accel.y(), r.accel.x(), r.accel.z());
                         }),
           "error", "camera-IMU rotation", "true x = y, y = -x, z = z as recorded");
}

TEST_F(SensorFaults, AccelerometerAxesOtherThanTheGyros) {
    expect(with_readings(good(), [](ImuReading& r) { std::swap(r.accel.x(), r.accel.z()); }),
           "error", "gravity's turn", "axes of accelerometer and gyro differ");
}

TEST_F(SensorFaults, CameraUpsideDown) {
    Written recording = good();
    recording.rig.T_B_C.R = recording.rig.T_B_C.R * so3::exp(Vector3d(0, 0, std::numbers::pi));
    expect(recording, "error", "camera-IMU rotation", "in cameraPose: true x = -x, y = -y, z = z");
}

TEST_F(SensorFaults, ExtrinsicRotationWrongByARightAngle) {
    for (int axis = 0; axis < 3; ++axis) {
        Written recording = good();
        recording.rig.T_B_C.R =
            recording.rig.T_B_C.R * so3::exp(std::numbers::pi / 2 * Vector3d::Unit(axis));
        expect(recording, "error", "camera-IMU rotation", "in cameraPose: true ");
    }
}

TEST_F(SensorFaults, ExtrinsicRotationWrongByFiveDegrees) {
    Written recording = good();
    recording.rig.T_B_C.R = recording.rig.T_B_C.R * so3::exp(Vector3d(0, 5 * kDegree, 0));
    expect(recording, "warning", "camera-IMU rotation",
           "calibrate the rotation between camera and IMU");
}

TEST_F(SensorFaults, FocalLengthWrongByTenPercent) {
    // The structure that is estimated with it takes up part of the error, more of it where the
    // focal length is too long.
    for (const auto& [factor, grade] : {std::pair{0.9, "error"}, std::pair{1.1, "warning"}}) {
        const auto& camera = dynamic_cast<const PerspectiveCamera&>(*good_recording().rig().camera);
        PerspectiveParameters p = camera.parameters();
        p.fx *= factor;
        p.fy *= factor;
        Written recording = good();
        recording.rig.camera = std::make_shared<PerspectiveCamera>(p);
        expect(recording, grade, "focal length", "calibrate the camera");
    }
}

// The advice, taken word by word, mends it: also where what was stated is wrong and zero is right.
TEST_F(SensorFaults, TimeOffset) {
    for (const double stated : {0.0, -0.05}) {
        Written recording = with_readings(
            good(), [&](ImuReading& r) { r.t += from_seconds(stated == 0 ? 0.05 : 0); });
        recording.rig.time_offset = stated;
        expect(recording, "error", "time offset", "set time_offset_s = ");
        const std::string file = folder_ / "recording.rawlog", mended = folder_ / "mended.ini";
        const std::string told = vio_slam("check " + file, folder_.path().string()).out;
        std::smatch advice;
        ASSERT_TRUE(std::regex_search(
            told, advice,
            std::regex(R"(set (time_offset_s = \S+) under (\[imu\]) in the calibration)")))
            << told;
        EXPECT_EQ(advice.str(1).find("-0"), std::string::npos) << advice.str();
        std::ofstream(mended) << advice.str(2) << "\n" << advice.str(1) << "\n";
        const ProgramResult again =
            vio_slam("check " + file + " --calibration " + mended, folder_.path().string());
        EXPECT_EQ(again.exit_code, 0) << again.err;
        EXPECT_NE(again.out.find("\nok        time offset"), std::string::npos) << again.out;
    }
}

TEST_F(SensorFaults, TwoClocks) {
    expect(with_readings(good(), [](ImuReading& r) { r.t += from_seconds(1000); }), "error",
           "common time", "do their stamps come from one clock?");
}

TEST_F(SensorFaults, ReadingsMissing) {
    for (const double seconds : {0.1, 1.0, 10.0}) {
        Written recording = good();
        const TimeNs begin = good_recording().image_times()[20],
                     end = begin + from_seconds(seconds);
        std::erase_if(recording.messages, [&](const Message& message) {
            const auto* reading = std::get_if<ImuReading>(&message);
            return reading && reading->t >= begin && reading->t < end;
        });
        expect(recording, seconds > 0.5 ? "error" : "warning", "IMU gaps", "1 gaps");
    }
}

TEST_F(SensorFaults, ReadingsTwice) {
    for (const double seconds : {0.1, 1.0, 10.0}) {
        const Written recording = good();
        Written twice{recording.rig, {}};
        const TimeNs begin = good_recording().image_times()[20],
                     end = begin + from_seconds(seconds);
        std::vector<Message> stretch;
        bool done = false;
        for (const Message& message : recording.messages) {
            const auto* reading = std::get_if<ImuReading>(&message);
            if (reading && reading->t > end && !done) {
                twice.messages.insert(twice.messages.end(), stretch.begin(), stretch.end());
                done = true;
            }
            twice.messages.push_back(message);
            if (reading && reading->t >= begin) stretch.push_back(message);
        }
        expect(twice, seconds > 1 ? "error" : "warning", "IMU order", "repeated stamps");
    }
}

TEST_F(SensorFaults, TimeGoesBackwards) {
    const TimeNs from = good_recording().image_times()[120];
    Written recording = good();
    for (Message& message : recording.messages)
        std::visit(
            [&](auto& m) {
                if (m.t >= from) m.t -= from_seconds(2);
            },
            message);
    expect(recording, "error", "IMU order", "steps back, largest ");
}

TEST_F(SensorFaults, ImagesDropped) {
    Written recording = good();
    int image = 0;
    std::erase_if(recording.messages, [&](const Message& message) {
        return std::holds_alternative<FeatureFrame>(message) && image++ % 10 == 3;
    });
    expect(recording, "warning", "image gaps", "frames were dropped");
}

TEST_F(SensorFaults, ReadingsStuckAndClipped) {
    ImuReading last;
    int i = 0;
    expect(with_readings(good(),
                         [&](ImuReading& r) {
                             if (++i > 1000 && i < 1040) {
                                 r.gyro = last.gyro;
                                 r.accel = last.accel;
                             }
                             last = r;
                         }),
           "warning", "IMU stuck", "repeats old readings");
    expect(with_readings(good(),
                         [](ImuReading& r) {
                             r.accel *= 3;  // hits on the way: beyond the range of 2 g
                             r.accel = r.accel.cwiseMax(-19.6).cwiseMin(19.6);
                         }),
           "error", "IMU range", "beyond its range");
}

// Wide cameras are judged by rays: what is right is not suspected, what is wrong is told as with a
// perspective camera.
TEST_F(SensorFaults, FisheyeAndMirror) {
    for (const Simulation* simulation : {&fisheye_recording(), &mirror_recording()}) {
        const Written good = as_written(*simulation);
        write(good, folder_ / "good.rawlog");
        const ProgramResult result =
            vio_slam("check " + (folder_ / "good.rawlog"), folder_.path().string());
        EXPECT_NE(result.out.find("0 errors, 0 warnings"), std::string::npos) << result.out;

        Written upside_down = good;
        upside_down.rig.T_B_C.R *= so3::exp(Vector3d(0, 0, std::numbers::pi));
        expect(upside_down, "error", "camera-IMU rotation", "in cameraPose: true x = -x, y = -y");
        expect(with_readings(good, [](ImuReading& r) { r.gyro /= kDegree; }), "error", "gyro scale",
               "in deg/s: multiply it by pi/180");
        expect(with_readings(good, [](ImuReading& r) { std::swap(r.gyro.x(), r.gyro.z()); }),
               "error", "camera-IMU rotation", "mirror image");
        expect(with_readings(good, [](ImuReading& r) { r.t += from_seconds(0.05); }), "error",
               "time offset", "set time_offset_s = 0.0");
    }
}

// Rotations between images come out nearly right with too long a focal length, so that the gyro
// does not tell it; the angles between rays do.
TEST_F(SensorFaults, FisheyesFocalLengthWrongByTenPercent) {
    for (const double factor : {0.9, 1.1}) {
        Written recording = as_written(fisheye_recording());
        FisheyeParameters p =
            dynamic_cast<const FisheyeCamera&>(*recording.rig.camera).parameters();
        p.fx *= factor;
        p.fy *= factor;
        recording.rig.camera = std::make_shared<FisheyeCamera>(p);
        expect(recording, "error", "angles of rays",
               "its intrinsics (focal length, a mirror's gain)");
    }
}

TEST_F(SensorFaults, MirrorsGainWrongByTenPercent) {
    for (const double factor : {0.9, 1.1}) {
        Written recording = as_written(mirror_recording());
        MirrorParameters p = dynamic_cast<const MirrorCamera&>(*recording.rig.camera).parameters();
        p.shape.gain *= factor;
        recording.rig.camera = std::make_shared<MirrorCamera>(p);
        expect(recording, "error", "angles of rays",
               "its intrinsics (focal length, a mirror's gain)");
    }
}

// A tenth of the gravity is easily hidden by the accelerations of half a second.
TEST_F(SensorFaults, TooShortToTell) {
    const std::string demo = VIO_SOURCE_DIR "/datasets/demo.rawlog";
    const ProgramResult result = vio_slam(
        "run " + demo + " --from 3 --to 3.2 -o " + (folder_ / "out"), folder_.path().string());
    EXPECT_EQ(result.out.find("gravity"), std::string::npos) << result.out;
}

// A vehicle that turns to and fro about the vertical keeps its specific force; its gyro tells that
// it is not at rest. At rest, the noise alone is in the readings, whatever the accelerometer's
// unit.
TEST_F(SensorFaults, OnlyRestIsCalledRest) {
    constexpr double kRate = 200, kSeconds = 20;
    const ImuNoise noise;
    std::mt19937 random(1);
    std::normal_distribution<double> normal;
    const auto noisy = [&](const Vector3d& value, double density) -> Vector3d {
        return value + density * std::sqrt(kRate) * normal_vector<3>(normal, random);
    };
    for (const double amplitude : {0.0, 0.3})
        for (const double unit : {1.0, 1 / 9.80665}) {
            std::vector<ImuReading> readings;
            for (int i = 0; i < kSeconds * kRate; ++i) {
                const double turn = amplitude * std::sin(std::numbers::pi * i / kRate);
                readings.push_back({from_seconds(i / kRate),
                                    noisy({0, 0, turn}, noise.gyro_noise_density),
                                    unit * noisy({0, 0, 9.80665}, noise.accel_noise_density)});
            }
            const Rest rest = find_rest(readings, noise);
            if (amplitude > 0) {
                EXPECT_EQ(rest.seconds, 0);
                continue;
            }
            EXPECT_NEAR(rest.seconds, kSeconds, 1);
            EXPECT_NEAR(rest.gravity / unit, 9.80665, 0.01);
        }
}

// `run` says the line of `check` before its own report.
TEST_F(SensorFaults, RunTellsToo) {
    const std::string file = folder_ / "recording.rawlog";
    write(with_readings(good(), [](ImuReading& r) { r.accel /= 9.80665; }), file);
    const ProgramResult result =
        vio_slam("run " + file + " --to 3 -o " + (folder_ / "out"), folder_.path().string());
    EXPECT_EQ(result.out.rfind("error       gravity: ", 0), 0u) << result.out;
    EXPECT_NE(result.out.find("in g: multiply it by 9.80665"), std::string::npos) << result.out;
}

}  // namespace
}  // namespace vio::test
