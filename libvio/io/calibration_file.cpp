#include "libvio/io/calibration_file.h"

#include <mrpt/config/CConfigFile.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <sstream>
#include <vector>

#include "libvio/base/errors.h"
#include "libvio/camera/perspective.h"
#include "libvio/io/text.h"

namespace vio {
namespace {

// A value without the comment behind it, which MRPT leaves in.
std::string without_comment(const std::string& value) {
    const auto comment = std::min(value.find_first_of("#;"), value.find("//"));
    return std::string(trimmed(std::string_view(value).substr(0, comment)));
}

// One key of the file, with the words for an error about it.
struct Entry {
    std::string file, section, key, value;

    InputError error(const std::string& problem) const {
        return InputError(file + " [" + section + "] " + key + ": " + problem);
    }

    std::vector<double> numbers() const {
        std::istringstream words(value);
        std::vector<double> all;
        for (std::string word; words >> word;) {
            const auto number = parse_double(word);
            if (!number) throw error("'" + word + "' is not a finite number");
            all.push_back(*number);
        }
        return all;
    }

    double number() const {
        const auto all = numbers();
        if (all.size() != 1) throw error("expected one number");
        return all[0];
    }

    double positive() const {
        const double value_given = number();
        if (!(value_given > 0)) throw error("must be positive");
        return value_given;
    }

    double share() const {
        const double value_given = number();
        if (!(value_given >= 0 && value_given < 1)) throw error("must be from 0 to 1");
        return value_given;
    }

    int size_px() const {
        const double value_given = positive();
        if (value_given != std::floor(value_given) || value_given > 100000)
            throw error("expected a whole number of pixels");
        return static_cast<int>(value_given);
    }

    Pose pose() const {
        const auto v = numbers();
        if (v.size() != 7) throw error("expected seven numbers: x y z [m] qx qy qz qw");
        const Eigen::Quaterniond q(v[6], v[3], v[4], v[5]);
        if (std::abs(q.norm() - 1) > 0.01) throw error("the quaternion is not of unit length");
        return {q.normalized().toRotationMatrix(), {v[0], v[1], v[2]}};
    }

    std::array<double, 8> distortion() const {
        const auto v = numbers();
        if (v.size() != 4 && v.size() != 5 && v.size() != 8)
            throw error("expected 4, 5 or 8 numbers: k1 k2 p1 p2 [k3 [k4 k5 k6]]");
        std::array<double, 8> all{};
        std::copy(v.begin(), v.end(), all.begin());
        return all;
    }
};

// Intrinsics as far as they are known.
struct PartialCamera {
    PerspectiveParameters parameters;
    bool changed = false;
};

void apply_camera(const Entry& e, PartialCamera& camera, Rig& rig) {
    PerspectiveParameters& p = camera.parameters;
    if (e.key == "T_B_C") {
        rig.T_B_C = e.pose();
        return;
    }
    camera.changed = true;
    if (e.key == "model") {
        if (e.value != "perspective")
            throw e.error("'" + e.value + "' is not a supported model; perspective is");
    } else if (e.key == "width")
        p.width = e.size_px();
    else if (e.key == "height")
        p.height = e.size_px();
    else if (e.key == "fx")
        p.fx = e.positive();
    else if (e.key == "fy")
        p.fy = e.positive();
    else if (e.key == "cx")
        p.cx = e.number();
    else if (e.key == "cy")
        p.cy = e.number();
    else if (e.key == "distortion")
        p.distortion = e.distortion();
    else
        throw e.error("no such key; share/formats.md lists them");
}

void apply_imu(const Entry& e, Rig& rig) {
    ImuNoise& noise = rig.imu_noise;
    if (e.key == "gyro_noise_density")
        noise.gyro_noise_density = e.positive();
    else if (e.key == "accel_noise_density")
        noise.accel_noise_density = e.positive();
    else if (e.key == "gyro_bias_random_walk")
        noise.gyro_bias_random_walk = e.positive();
    else if (e.key == "accel_bias_random_walk")
        noise.accel_bias_random_walk = e.positive();
    else if (e.key == "gyro_sensitivity_error")
        noise.gyro_sensitivity_error = e.share();
    else if (e.key == "T_B_I")
        rig.T_B_I = e.pose();
    else if (e.key == "time_offset_s")
        rig.time_offset = e.number();
    else
        throw e.error("no such key; share/formats.md lists them");
}

// Makes the camera of the parameters given and those of the camera before.
void set_camera(const std::string& file, const mrpt::config::CConfigFile& ini,
                const PartialCamera& camera, Rig& rig) {
    if (!rig.camera)
        for (const char* key : {"width", "height", "fx", "fy", "cx", "cy"})
            if (!ini.keyExists("camera", key))
                throw InputError(file + " [camera]: " + key +
                                 " is missing; the recording has no calibration, so give width, "
                                 "height, fx, fy, cx and cy");
    try {
        rig.camera = std::make_shared<PerspectiveCamera>(camera.parameters);
    } catch (const InputError& reason) {
        throw InputError(file + " [camera]: " + reason.what());
    }
}

std::string pose_text(const Pose& T) {
    Eigen::Quaterniond q(T.R);
    if (q.w() < 0) q.coeffs() *= -1;
    std::string text;
    for (int i = 0; i < 3; ++i) text += format(T.p(i)) + " ";
    for (int i = 0; i < 4; ++i) text += format(q.coeffs()(i)) + (i < 3 ? " " : "");
    return text;
}

// "key = value" lines, each below a comment with meaning and unit.
void put(std::string& text, const char* comment, const char* key, const std::string& value) {
    if (*comment) text.append("# ").append(comment).append("\n");
    text.append(key).append(" = ").append(value).append("\n");
}

std::string imu_section(const Rig& rig, bool with_pose) {
    const ImuNoise& n = rig.imu_noise;
    std::string text = "[imu]\n";
    put(text, "white noise [rad/s/sqrt(Hz)]", "gyro_noise_density", format(n.gyro_noise_density));
    put(text, "white noise [m/s^2/sqrt(Hz)]", "accel_noise_density", format(n.accel_noise_density));
    put(text, "random walk of the bias [rad/s^2/sqrt(Hz)]", "gyro_bias_random_walk",
        format(n.gyro_bias_random_walk));
    put(text, "random walk of the bias [m/s^3/sqrt(Hz)]", "accel_bias_random_walk",
        format(n.accel_bias_random_walk));
    put(text, "gyro errors that follow the motion (scale, alignment), share of the rate [-]",
        "gyro_sensitivity_error", format(n.gyro_sensitivity_error));
    put(text, "t_imu = t_cam + time_offset [s]", "time_offset_s", format(rig.time_offset));
    if (with_pose)
        put(text, "IMU in the vehicle frame: x y z [m] qx qy qz qw", "T_B_I", pose_text(rig.T_B_I));
    return text;
}

std::string camera_section(const Rig& rig) {
    std::string text = "[camera]\n";
    if (const auto* camera = dynamic_cast<const PerspectiveCamera*>(rig.camera.get())) {
        const PerspectiveParameters& p = camera->parameters();
        std::string distortion;
        for (const double k : p.distortion)
            distortion.append(distortion.empty() ? "" : " ").append(format(k));
        put(text, "", "model", "perspective");
        put(text, "image size [px]", "width", std::to_string(p.width));
        put(text, "", "height", std::to_string(p.height));
        put(text, "focal lengths [px]", "fx", format(p.fx));
        put(text, "", "fy", format(p.fy));
        put(text, "image centre [px]", "cx", format(p.cx));
        put(text, "", "cy", format(p.cy));
        put(text, "k1 k2 p1 p2 k3 k4 k5 k6", "distortion", distortion);
    }
    put(text, "camera in the vehicle frame: x y z [m] qx qy qz qw", "T_B_C", pose_text(rig.T_B_C));
    return text;
}

}  // namespace

void load_calibration(const std::string& file, Rig& rig) {
    if (!std::filesystem::is_regular_file(file))
        throw InputError(file + ": no such file; name an existing calibration file");
    const mrpt::config::CConfigFile ini(file);
    PartialCamera camera;
    if (const auto* known = dynamic_cast<const PerspectiveCamera*>(rig.camera.get()))
        camera.parameters = known->parameters();

    std::vector<std::string> sections, keys;
    ini.getAllSections(sections);
    for (const std::string& section : sections) {
        ini.getAllKeys(section, keys);
        if (section.empty() && keys.empty()) continue;
        if (section != "camera" && section != "imu")
            throw InputError(file + " [" + section + "]: no such section; camera and imu are");
        for (const std::string& key : keys) {
            const Entry entry{file, section, key,
                              without_comment(ini.read_string(section, key, ""))};
            section == "camera" ? apply_camera(entry, camera, rig) : apply_imu(entry, rig);
        }
    }
    if (camera.changed) set_camera(file, ini, camera, rig);
}

std::string imu_calibration_text(const Rig& rig) {
    return "# Calibration that a rawlog has no field for; read together with the rawlog.\n" +
           imu_section(rig, false);
}

std::string calibration_text(const Rig& rig) {
    return "# Calibration of camera and IMU\n" + camera_section(rig) + "\n" +
           imu_section(rig, true);
}

}  // namespace vio
