#include <Eigen/Dense>

#include "libvio/camera/description.h"
#include "libvio/io/calibration_file.h"
#include "libvio/io/text.h"

namespace vio {
namespace {

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

// Place of the inverse, for the reader of the file.
std::string inverse_comment(const char* meaning, const char* inverse, const Pose& T) {
    return std::string(meaning) + ": x y z [m] qx qy qz qw; inverse, " + inverse + ": " +
           pose_text(T.inverse());
}

void put_noise(std::string& text, const ImuNoise& n) {
    put(text, "white noise [rad/s/sqrt(Hz)]", "gyro_noise_density", format(n.gyro_noise_density));
    put(text, "white noise [m/s^2/sqrt(Hz)]", "accel_noise_density", format(n.accel_noise_density));
    put(text, "random walk of the bias [rad/s^2/sqrt(Hz)]", "gyro_bias_random_walk",
        format(n.gyro_bias_random_walk));
    put(text, "random walk of the bias [m/s^3/sqrt(Hz)]", "accel_bias_random_walk",
        format(n.accel_bias_random_walk));
}

std::string imu_section(const Rig& rig, bool with_pose) {
    std::string text = "[imu]\n";
    put_noise(text, rig.imu_noise);
    put(text, "gyro errors that follow the motion (scale, alignment), share of the rate [-]",
        "gyro_sensitivity_error", format(rig.imu_noise.gyro_sensitivity_error));
    put(text, "t_imu = t_cam + time_offset [s]", "time_offset_s", format(rig.time_offset));
    if (with_pose)
        put(text, inverse_comment("IMU in the vehicle frame", "T_I_B", rig.T_B_I).c_str(), "T_B_I",
            pose_text(rig.T_B_I));
    return text;
}

void put_mirror(std::string& text, const CameraDescription& d) {
    const MirrorShapeParameters& s = d.shape;
    put(text, "from the camera's centre to the mirror's apex [m]", "apex_distance",
        format(s.apex_distance));
    if (s.kind == MirrorShapeParameters::Kind::kEquiangular)
        put(text, "angle of the ray over angle in the image [-]", "gain", format(s.gain));
    if (s.kind == MirrorShapeParameters::Kind::kHyperbolic)
        put(text, "[-]", "eccentricity", format(s.eccentricity));
    if (s.kind == MirrorShapeParameters::Kind::kParabolic)
        put(text, "[m]", "semi_latus_rectum", format(s.semi_latus_rectum));
    put(text, "of the mirror, and of its middle, in which the camera sees itself [m]", "rim_radius",
        format(s.rim_radius));
    put(text, "", "blind_radius", format(s.blind_radius));
    put(text, inverse_comment("mirror in the camera frame", "T_M_C", d.T_C_M).c_str(), "T_C_M",
        pose_text(d.T_C_M));
}

void put_camera(std::string& text, const Camera& camera) {
    const CameraDescription d = describe(camera);
    const PerspectiveParameters& p = d.lens;
    const bool fisheye = d.model == "fisheye", unified = d.model == "unified";
    put(text, "", "model", d.model);
    put(text, "image size [px]", "width", std::to_string(p.width));
    put(text, "", "height", std::to_string(p.height));
    put(text,
        fisheye                         ? "focal lengths [px/rad]"
        : d.model == "parabolic_mirror" ? "scale of the telecentric lens [px/m]"
                                        : "focal lengths [px]",
        "fx", format(p.fx));
    put(text, "", "fy", format(p.fy));
    put(text, "image centre [px]", "cx", format(p.cx));
    put(text, "", "cy", format(p.cy));
    std::string distortion;
    for (std::size_t i = 0; i < (fisheye ? 4 : p.distortion.size()); ++i)
        distortion.append(i == 0 ? "" : " ").append(format(p.distortion[i]));
    put(text, fisheye ? "k1 k2 k3 k4 [-]" : "k1 k2 p1 p2 k3 k4 k5 k6 [-]", "distortion",
        distortion);
    if (unified) {
        put(text, "centre of projection from the sphere's centre [-]", "xi", format(d.xi));
        put(text, "the camera looks into a mirror", "mirror", d.mirror ? "true" : "false");
        put(text, "innermost and outermost ray, from the middle's [rad]", "min_angle",
            format(d.min_angle));
    }
    if (fisheye) text += "# outermost ray, from the middle's [rad]\n";
    if (fisheye || unified) put(text, "", "max_angle", format(d.max_angle));
    if (is_mirror_model(d.model)) put_mirror(text, d);
}

std::string camera_section(const Rig& rig, bool with_pose) {
    std::string text = "[camera]\n";
    if (rig.camera) put_camera(text, *rig.camera);
    if (with_pose)
        put(text, inverse_comment("camera in the vehicle frame", "T_C_B", rig.T_B_C).c_str(),
            "T_B_C", pose_text(rig.T_B_C));
    return text;
}

}  // namespace

std::string camera_summary(const Camera& camera) {
    std::string text, line;
    put_camera(text, camera);
    for (std::size_t begin = 0; begin < text.size();) {
        const std::size_t end = text.find('\n', begin);
        const std::string row = text.substr(begin, end - begin);
        begin = end + 1;
        if (row.starts_with("#") || row.starts_with("T_C_M")) continue;
        line.append(line.empty() ? "" : ", ").append(row);
    }
    return line;
}

std::string sidecar_text(const Rig& rig, bool with_camera) {
    return "# Calibration that a rawlog has no field for; read together with the rawlog.\n" +
           (with_camera ? camera_section(rig, false) + "\n" : "") + imu_section(rig, false);
}

std::string noise_text(const ImuNoise& noise) {
    std::string text = "[imu]\n";
    put_noise(text, noise);
    return text;
}

std::string camera_text(const Rig& rig) {
    return "# Intrinsics of a camera\n" + camera_section(rig, false);
}

std::string calibration_text(const Rig& rig) {
    return "# Calibration of camera and IMU\n" + camera_section(rig, true) + "\n" +
           imu_section(rig, true);
}

}  // namespace vio
