// What the agreement of gyro and images, and of images with each other, means to the user.
#include <cmath>

#include "libvio/base/angles.h"
#include "libvio/camera/fisheye.h"
#include "libvio/camera/perspective.h"
#include "libvio/check/angular_scale.h"
#include "libvio/check/axes.h"
#include "libvio/check/rotation_agreement.h"

namespace vio {
namespace {

constexpr double kWellExplained = 0.9, kExplained = 0.5;
constexpr double kFewestRate = 0.02;                    // [rad/s]
constexpr double kGoodGain = 0.03, kPoorGain = 0.15;    // of the gyro, from 1
constexpr double kGoodFocal = 0.03, kPoorFocal = 0.07;  // relative
constexpr double kGoodAngle = 2 * kDegree, kPoorAngle = 10 * kDegree;
constexpr double kGoodOffset = 0.005, kPoorOffset = 0.03;  // [s]
constexpr double kSigmas = 4;                              // below which a deviation is none

// What is beyond `poor` is an error. Where noise could make the deviation, or hides one that is
// poor, nothing is told.
Grade grade(double deviation, double sigma, double good, double poor) {
    if (kSigmas * sigma > 2 * poor) return Grade::untested;
    const double sure = std::abs(deviation) - kSigmas * sigma;
    if (std::abs(deviation) <= good) return Grade::ok;
    if (sure <= 0) return Grade::untested;
    return std::abs(deviation) > poor && sure > good ? Grade::error : Grade::warning;
}

Finding agreement(const RotationAgreement& a) {
    Finding f{Grade::ok, "gyro against images",
              formatted("%.1f %% of the rotation explained (%d pairs of images, %.1f deg/s rms, "
                        "noise %.2f deg)",
                        1e2 * a.explained, a.pairs, a.image_rate / kDegree, a.noise / kDegree),
              formatted("at least %g %%", 1e2 * kWellExplained), ""};
    if (a.explained >= kWellExplained) return f;
    if (a.axes == 0 && a.image_rate < kFewestRate) {
        f.grade = Grade::untested;
        f.measured += "; too little rotation to tell";
        return f;
    }
    f.grade = a.explained < kExplained ? Grade::error : Grade::warning;
    f.advice =
        "gyro and camera do not see one motion: see that both sit on one rigid body, that "
        "their stamps come from one clock, and the camera's calibration";
    return f;
}

Finding offset(const RotationAgreement& a, const Rig& rig) {
    Finding f{grade(a.offset, a.offset_sigma, kGoodOffset, kPoorOffset), "time offset",
              formatted("%+.4f +- %.4f s from the calibration's", a.offset, a.offset_sigma),
              formatted("at most %g s", kGoodOffset), ""};
    // To a tenth of a millisecond; 0.0 is added so that zero has no sign.
    const double better = std::round(1e4 * (rig.time_offset + a.offset)) / 1e4 + 0.0;
    if (f.grade >= Grade::warning)
        f.advice = formatted("set time_offset_s = %g under [imu] in the calibration (it is %g)",
                             better, rig.time_offset);
    return f;
}

Finding unit(const RotationAgreement& a) {
    Finding f{grade(a.gain - 1, a.gain_sigma, kGoodGain, kPoorGain), "gyro scale",
              formatted("images turn %.3f +- %.3f times as far", a.gain, a.gain_sigma),
              formatted("1 +- %g", kGoodGain), ""};
    if (f.grade <= Grade::ok) return f;
    f.advice = "the gyro's scale or the camera's focal length is wrong";
    if (std::abs(a.gain / kDegree - 1) < 0.2)
        f.advice = "the gyro is in deg/s: multiply it by pi/180";
    if (std::abs(a.gain * kDegree - 1) < 0.2)
        f.advice = "the gyro was converted from deg/s twice: multiply it by 180/pi";
    return f;
}

Finding turn(const RotationAgreement& a) {
    Finding f{grade(a.angle, a.angle_sigma, kGoodAngle, kPoorAngle), "camera-IMU rotation",
              formatted("%.2f +- %.2f deg from the calibration's, about %d axes", a.angle / kDegree,
                        a.angle_sigma / kDegree, a.axes),
              formatted("at most %g deg", kGoodAngle / kDegree), ""};
    if (a.mirrored) {
        f.grade = Grade::error;
        f.measured = "the gyro's axes are a mirror image of the camera's";
    }
    if (f.grade <= Grade::ok) return f;
    f.advice = "calibrate the rotation between camera and IMU";
    if (a.imu_axes) f.advice = "the gyro's axes: true " + axes_text(*a.imu_axes) + " as recorded";
    if (a.camera_axes && !a.mirrored)
        f.advice += std::string(a.imu_axes ? "; or " : "; ") + "the camera's in cameraPose: true " +
                    axes_text(*a.camera_axes) + " as stated";
    return f;
}

Finding focal_length(const RotationAgreement& a, const Rig& rig) {
    Finding f{
        grade(a.focal_ratio - 1, a.focal_sigma, kGoodFocal, kPoorFocal), "focal length",
        formatted("%.3f +- %.3f times the stated one, by the gyro", a.focal_ratio, a.focal_sigma),
        formatted("1 +- %g", kGoodFocal), ""};
    const bool has_one = dynamic_cast<const PerspectiveCamera*>(rig.camera.get()) ||
                         dynamic_cast<const FisheyeCamera*>(rig.camera.get());
    if (!has_one) f.name = "camera's angular scale";
    if (f.grade >= Grade::warning)
        f.advice =
            "calibrate the camera: see whether its intrinsics are for these images' size "
            "and lens";
    return f;
}

}  // namespace

std::vector<Finding> check_rotations(const std::optional<RotationAgreement>& agreed,
                                     const Rig& rig) {
    if (!agreed)
        return {{Grade::untested, "gyro against images",
                 "too few images with features and readings on both sides", "", ""}};
    const RotationAgreement& a = *agreed;
    std::vector<Finding> findings{agreement(a)};
    if (a.axes == 0 || a.explained < kExplained) return findings;
    findings.push_back(offset(a, rig));
    findings.push_back(unit(a));
    findings.push_back(turn(a));
    const bool turned_wrongly = findings.back().grade == Grade::error;
    const bool scaled_wrongly = std::abs(a.gain - 1) > kPoorGain;
    if (!turned_wrongly && !scaled_wrongly && a.focal_sigma > 0)
        findings.push_back(focal_length(a, rig));
    return findings;
}

Finding check_angles(const std::optional<AngularScale>& angles) {
    Finding f{Grade::untested, "angles of rays", "too few images that agree on one motion",
              formatted("1 +- %g", kGoodFocal), ""};
    if (!angles) return f;
    f.grade = grade(angles->scale - 1, angles->sigma, kGoodFocal, kPoorFocal);
    f.measured = formatted("%.3f +- %.3f times the stated ones, by %d pairs of images",
                           angles->scale, angles->sigma, angles->pairs);
    if (f.grade >= Grade::warning)
        f.advice =
            "calibrate the camera: see whether its intrinsics (focal length, a mirror's gain) are "
            "for these images' size and lens";
    return f;
}

}  // namespace vio
