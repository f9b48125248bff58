#include "libvio/io/calibration_file.h"

#include <mrpt/config/CConfigFile.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <sstream>
#include <vector>

#include "libvio/base/errors.h"
#include "libvio/base/files.h"
#include "libvio/base/ini_file.h"
#include "libvio/camera/description.h"
#include "libvio/io/text.h"
#include "libvio/io/yaml_calibration.h"

namespace vio {
namespace {

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

    int size_px(double value_given) const {
        if (!(value_given > 0) || value_given != std::floor(value_given) || value_given > 100000)
            throw error("expected a whole number of pixels");
        return static_cast<int>(value_given);
    }
    int size_px() const { return size_px(number()); }

    Pose pose() const {
        const auto v = numbers();
        if (v.size() != 7) throw error("expected seven numbers: x y z [m] qx qy qz qw");
        const Eigen::Quaterniond q(v[6], v[3], v[4], v[5]);
        if (std::abs(q.norm() - 1) > 0.01) throw error("the quaternion is not of unit length");
        return {q.normalized().toRotationMatrix(), {v[0], v[1], v[2]}};
    }

    double not_negative() const {
        const double value_given = number();
        if (!(value_given >= 0)) throw error("must not be negative");
        return value_given;
    }

    bool truth() const {
        if (value == "true" || value == "1") return true;
        if (value == "false" || value == "0") return false;
        throw error("expected true or false");
    }

    std::array<double, 8> distortion(bool fisheye) const {
        const auto v = numbers();
        if (fisheye && v.size() != 4) throw error("expected 4 numbers: k1 k2 k3 k4");
        if (v.size() != 4 && v.size() != 5 && v.size() != 8)
            throw error("expected 4, 5 or 8 numbers: k1 k2 p1 p2 [k3 [k4 k5 k6]]");
        std::array<double, 8> all{};
        std::copy(v.begin(), v.end(), all.begin());
        return all;
    }
};

// One key of [camera]: models that have it, and whether a whole camera needs it.
struct CameraKey {
    const char* name;
    bool (*belongs)(const std::string& model);
    bool needed;
    void (*set)(const Entry&, CameraDescription&);
};

bool any_model(const std::string&) {
    return true;
}
bool fisheye_or_unified(const std::string& model) {
    return model == "fisheye" || model == "unified";
}
template <const char* kModel>
bool only(const std::string& model) {
    return model == kModel;
}
constexpr char kUnified[] = "unified", kEquiangular[] = "equiangular_mirror",
               kHyperbolic[] = "hyperbolic_mirror", kParabolic[] = "parabolic_mirror";

using D = CameraDescription;
const CameraKey kCameraKeys[] = {
    {"model", any_model, false, [](const Entry&, D&) {}},  // comes first of all
    {"width", any_model, true, [](const Entry& e, D& d) { d.lens.width = e.size_px(); }},
    {"height", any_model, true, [](const Entry& e, D& d) { d.lens.height = e.size_px(); }},
    {"fx", any_model, true, [](const Entry& e, D& d) { d.lens.fx = e.positive(); }},
    {"fy", any_model, true, [](const Entry& e, D& d) { d.lens.fy = e.positive(); }},
    {"cx", any_model, true, [](const Entry& e, D& d) { d.lens.cx = e.number(); }},
    {"cy", any_model, true, [](const Entry& e, D& d) { d.lens.cy = e.number(); }},
    {"distortion", any_model, false,
     [](const Entry& e, D& d) { d.lens.distortion = e.distortion(d.model == "fisheye"); }},
    {"max_angle", fisheye_or_unified, false,
     [](const Entry& e, D& d) { d.max_angle = e.positive(); }},
    {"min_angle", only<kUnified>, false,
     [](const Entry& e, D& d) { d.min_angle = e.not_negative(); }},
    {"xi", only<kUnified>, true, [](const Entry& e, D& d) { d.xi = e.not_negative(); }},
    {"mirror", only<kUnified>, false, [](const Entry& e, D& d) { d.mirror = e.truth(); }},
    {"apex_distance", is_mirror_model, true,
     [](const Entry& e, D& d) { d.shape.apex_distance = e.positive(); }},
    {"gain", only<kEquiangular>, true, [](const Entry& e, D& d) { d.shape.gain = e.positive(); }},
    {"eccentricity", only<kHyperbolic>, true,
     [](const Entry& e, D& d) { d.shape.eccentricity = e.positive(); }},
    {"semi_latus_rectum", only<kParabolic>, true,
     [](const Entry& e, D& d) { d.shape.semi_latus_rectum = e.positive(); }},
    {"rim_radius", is_mirror_model, true,
     [](const Entry& e, D& d) { d.shape.rim_radius = e.positive(); }},
    {"blind_radius", is_mirror_model, false,
     [](const Entry& e, D& d) { d.shape.blind_radius = e.not_negative(); }},
    {"T_C_M", is_mirror_model, false, [](const Entry& e, D& d) { d.T_C_M = e.pose(); }},
};

// Overrides the camera with the entries of [camera]; a camera of another model is made anew.
void apply_camera(const std::vector<Entry>& entries, const std::string& file, StatedRig& stated) {
    Rig& rig = stated.rig;
    CameraDescription d;
    if (rig.camera) d = describe(*rig.camera);
    bool whole = !rig.camera, changed = false;
    for (const Entry& e : entries)
        if (e.key == "model" && e.value != d.model) {
            const auto& models = camera_models();
            if (std::find(models.begin(), models.end(), e.value) == models.end())
                throw e.error("'" + e.value + "' is no camera model; share/formats.md lists them");
            d = {};
            d.model = e.value;
            whole = true;
        }
    for (const Entry& e : entries) {
        if (e.key == "T_B_C") {
            stated.set_T_B_C(e.pose());
            continue;
        }
        const auto key = std::find_if(std::begin(kCameraKeys), std::end(kCameraKeys),
                                      [&](const CameraKey& k) { return e.key == k.name; });
        if (key == std::end(kCameraKeys)) throw e.error("no such key; share/formats.md lists them");
        if (!key->belongs(d.model))
            throw e.error("a camera of model " + d.model + " has no such key");
        key->set(e, d);
        changed = true;
    }
    if (!changed) return;
    if (whole)
        for (const CameraKey& key : kCameraKeys)
            if (key.needed && key.belongs(d.model) &&
                std::none_of(entries.begin(), entries.end(),
                             [&](const Entry& e) { return e.key == key.name; }))
                throw InputError(file + " [camera]: " + key.name +
                                 " is missing; the recording has " + "no calibration of a " +
                                 d.model + " camera to complete");
    try {
        rig.camera = make_camera(d);
    } catch (const InputError& reason) {
        throw InputError(file + " [camera]: " + reason.what());
    }
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

// The format of this project.
void load_own(const std::string& file, const mrpt::config::CConfigFile& ini, StatedRig& stated) {
    std::vector<std::string> sections, keys;
    ini.getAllSections(sections);
    std::vector<Entry> camera;
    for (const std::string& section : sections) {
        ini.getAllKeys(section, keys);
        if (section.empty() && keys.empty()) continue;
        if (section != "camera" && section != "imu")
            throw InputError(file + " [" + section + "]: no such section; camera and imu are");
        for (const std::string& key : keys) {
            const Entry entry{file, section, key,
                              std::string(without_comment(ini.read_string(section, key, "")))};
            if (section == "camera")
                camera.push_back(entry);
            else
                apply_imu(entry, stated.rig);
        }
    }
    if (!camera.empty()) apply_camera(camera, file, stated);
}

// Section of a camera as MRPT's TCamera::saveToConfigFile writes it, if there is one. MRPT's own
// reader loses k3 and k4 of a fisheye.
std::optional<std::string> mrpt_section(const mrpt::config::CConfigFile& ini) {
    std::vector<std::string> sections;
    ini.getAllSections(sections);
    for (const std::string& section : sections)
        if (ini.keyExists(section, "resolution") && ini.keyExists(section, "fx")) return section;
    return std::nullopt;
}

void load_mrpt(const std::string& file, const mrpt::config::CConfigFile& ini,
               const std::string& section, Rig& rig) {
    const auto entry = [&](const char* key) {
        std::string value(without_comment(ini.read_string(section, key, "")));
        std::replace_if(
            value.begin(), value.end(), [](char c) { return c == '[' || c == ']' || c == ','; },
            ' ');
        const Entry e{file, section, key, value};
        if (!ini.keyExists(section, key)) throw e.error("is missing");
        return e;
    };
    CameraDescription d;
    const Entry resolution = entry("resolution");
    const auto size = resolution.numbers();
    if (size.size() != 2) throw resolution.error("expected width and height");
    d.lens.width = resolution.size_px(size[0]);
    d.lens.height = resolution.size_px(size[1]);
    d.lens.fx = entry("fx").positive();
    d.lens.fy = entry("fy").positive();
    d.lens.cx = entry("cx").number();
    d.lens.cy = entry("cy").number();
    // Older files have plumb_bob's coefficients and no model.
    std::string model = ini.keyExists(section, "dist") ? "plumb_bob" : "none";
    if (ini.keyExists(section, "distortion_model"))
        model = std::string(trimmed(entry("distortion_model").value));
    if (model == "kannala_brandt")
        d.model = "fisheye";
    else if (model != "plumb_bob" && model != "none")
        throw entry("distortion_model").error("'" + model + "' is not known");
    if (model != "none") d.lens.distortion = entry("dist").distortion(d.model == "fisheye");
    try {
        rig.camera = make_camera(d);
    } catch (const InputError& reason) {
        throw InputError(file + " [" + section + "]: " + reason.what());
    }
}

void load(const std::string& file, StatedRig& stated) {
    if (!is_file(file))
        throw InputError(file + ": no such file; name an existing calibration file");
    const std::string extension = std::filesystem::path(file).extension().string();
    if (extension == ".yaml" || extension == ".yml") return load_yaml_calibration(file, stated);
    const auto opened = open_ini(file);
    const auto& ini = *opened;
    if (const auto section = mrpt_section(ini))
        load_mrpt(file, ini, *section, stated.rig);
    else
        load_own(file, ini, stated);
}

}  // namespace

void load_calibrations(const std::vector<std::string>& files, Rig& rig) {
    StatedRig stated{rig, {}};
    for (const std::string& file : files) load(file, stated);
    rig = stated.resolved();
}

void load_calibration(const std::string& file, Rig& rig) {
    load_calibrations({file}, rig);
}

}  // namespace vio
