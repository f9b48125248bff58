#include "libvio/io/yaml_calibration.h"

#include <cmath>
#include <vector>

#include "libvio/base/errors.h"
#include "libvio/camera/description.h"
#include "libvio/io/yaml_file.h"

namespace vio {
namespace {

// Both formats name the distortion alike, but for the key of its coefficients.
void set_distortion(const Yaml& yaml, const std::string& coefficients, CameraDescription& d) {
    const auto model = yaml.get<std::string>("distortion_model");
    if (model == "none") return;
    const auto k = yaml.numbers(coefficients, 4);
    if (model == "radial-tangential" || model == "radtan" || model == "plumb_bob") {
        if (k.size() != 4 && k.size() != 5 && k.size() != 8)
            throw yaml.error(coefficients, "expected 4, 5 or 8 numbers");
    } else if (model == "equidistant" || model == "kannala_brandt") {
        if (k.size() != 4) throw yaml.error(coefficients, "expected 4 numbers");
        if (d.model != "perspective")
            throw yaml.error("distortion_model", "equidistant needs the camera model pinhole");
        d.model = "fisheye";
    } else {
        throw yaml.error("distortion_model", "'" + model +
                                                 "' is not known; radial-tangential, equidistant "
                                                 "and none are");
    }
    std::copy(k.begin(), k.end(), d.lens.distortion.begin());
}

CameraPtr read_camera(const Yaml& yaml, const std::string& coefficients) {
    CameraDescription d;
    const auto model = yaml.get<std::string>("camera_model");
    if (model == "omni")
        d.model = "unified";
    else if (model != "pinhole")
        throw yaml.error("camera_model", "'" + model + "' is not known; pinhole and omni are");
    const auto size = yaml.get<std::vector<int>>("resolution");
    if (size.size() != 2 || size[0] <= 0 || size[1] <= 0)
        throw yaml.error("resolution", "expected width and height");
    auto intrinsics = yaml.numbers("intrinsics", d.model == "unified" ? 5 : 4);
    if (d.model == "unified") {
        d.xi = intrinsics.front();
        intrinsics.erase(intrinsics.begin());
    }
    if (!(intrinsics[0] > 0) || !(intrinsics[1] > 0))
        throw yaml.error("intrinsics", "focal lengths must be positive");
    d.lens = {size[0], size[1], intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3], {}};
    set_distortion(yaml, coefficients, d);
    try {
        return make_camera(d);
    } catch (const InputError& reason) {
        throw yaml.error("intrinsics", reason.what());
    }
}

// Not one of ASL's keys: written by this project's export.
constexpr const char* kGyroSensitivityKey = "gyroscope_sensitivity_error";

void read_noise(const Yaml& yaml, ImuNoise& noise) {
    noise.gyro_noise_density = yaml.positive("gyroscope_noise_density");
    noise.gyro_bias_random_walk = yaml.positive("gyroscope_random_walk");
    noise.accel_noise_density = yaml.positive("accelerometer_noise_density");
    noise.accel_bias_random_walk = yaml.positive("accelerometer_random_walk");
    if (yaml.has(kGyroSensitivityKey))
        noise.gyro_sensitivity_error = yaml.get<double>(kGyroSensitivityKey);
}

}  // namespace

AslCamera read_asl_camera(const std::string& sensor_yaml) {
    const Yaml yaml(sensor_yaml);
    return {read_camera(yaml, "distortion_coefficients"), yaml.T_BS(), yaml.time_shift(0)};
}

AslImu read_asl_imu(const std::string& sensor_yaml) {
    const Yaml yaml(sensor_yaml);
    AslImu imu;
    imu.T_B_I = yaml.T_BS();
    read_noise(yaml, imu.noise);
    return imu;
}

Pose read_asl_extrinsics(const std::string& sensor_yaml) {
    return Yaml(sensor_yaml).T_BS();
}

void StatedRig::set_T_B_C(const Pose& T_B_C) {
    rig.T_B_C = T_B_C;
    T_I_C.reset();
}

Rig StatedRig::resolved() const {
    Rig all = rig;
    if (T_I_C) all.T_B_C = rig.T_B_I * *T_I_C;
    return all;
}

void load_yaml_calibration(const std::string& file, StatedRig& stated, const std::string& camera) {
    const Yaml yaml(file);
    Rig& rig = stated.rig;
    if (yaml.has("cam0")) {
        const Yaml part = yaml.part(camera);
        rig.camera = read_camera(part, "distortion_coeffs");
        if (part.has("T_cam_imu")) stated.T_I_C = part.rows("T_cam_imu").inverse();
        rig.time_offset = part.time_shift(rig.time_offset);
    } else if (yaml.has("camera_model")) {
        const AslCamera single = read_asl_camera(file);
        rig.camera = single.camera;
        stated.set_T_B_C(single.T_B_C);
        rig.time_offset = yaml.time_shift(rig.time_offset);
    } else if (yaml.has("imu0")) {
        read_noise(yaml.part("imu0"), rig.imu_noise);
    } else if (yaml.has("gyroscope_noise_density")) {
        read_noise(yaml, rig.imu_noise);
        if (yaml.has("T_BS")) rig.T_B_I = yaml.T_BS();
    } else {
        throw InputError(file +
                         ": is no calibration known here; sensor.yaml of an ASL data set and "
                         "Kalibr's camchain and imu files are");
    }
}

}  // namespace vio
