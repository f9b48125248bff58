#include "libvio/io/export.h"

#include <Eigen/Geometry>

#include "libvio/io/landmark_colour.h"
#include "libvio/io/text.h"
#include "libvio/io/trajectory_io.h"

namespace vio {
namespace {

Eigen::Vector4d wxyz(const Eigen::Matrix3d& R) {
    Eigen::Quaterniond q(R);
    if (q.w() < 0) q.coeffs() *= -1;
    return {q.w(), q.x(), q.y(), q.z()};
}

// VRML's cameras look along -z with y up.
std::string viewpoint(const Pose& T_W_C, const std::string& name) {
    const Eigen::Matrix3d R = T_W_C.R * Eigen::Vector3d(1, -1, -1).asDiagonal();
    const Eigen::AngleAxisd turn(R);
    return "Viewpoint { position " + joined(T_W_C.p, " ") + " orientation " +
           joined(turn.axis(), " ") + " " + format(turn.angle()) + " description \"" + name +
           "\" }\n";
}

std::string vrml_points(const Estimate& estimate) {
    const LandmarkColours colours(estimate.landmarks, natural_colour(estimate.landmarks));
    std::string points, colors;
    for (const LandmarkEstimate& landmark : estimate.landmarks) {
        points += joined(landmark.p_W, " ") + ",\n";
        const Rgb rgb = colours.rgb(landmark);
        colors +=
            joined(Eigen::Vector3d(Eigen::Vector3d(rgb[0], rgb[1], rgb[2]) / 255), " ") + ",\n";
    }
    return "Shape { geometry PointSet {\ncoord Coordinate { point [\n" + points +
           "] }\ncolor Color { color [\n" + colors + "] }\n} }\n";
}

std::string vrml_path(const Estimate& estimate) {
    std::string points, indices;
    for (size_t i = 0; i < estimate.states.size(); ++i) {
        points += joined(estimate.states[i].T_W_B.p, " ") + ",\n";
        indices += std::to_string(i) + " ";
    }
    return "Shape {\nappearance Appearance { material Material { emissiveColor 0.1 0.4 0.9 } }\n"
           "geometry IndexedLineSet {\ncoord Coordinate { point [\n" +
           points + "] }\ncoordIndex [ " + indices + "-1 ]\n} }\n";
}

}  // namespace

std::string write_kitti(const std::string& file, const Estimate& estimate) {
    std::string text, times;
    for (const StateEstimate& state : estimate.states) {
        times += format_seconds(state.t) + "\n";
        Eigen::Matrix<double, 12, 1> rows;
        for (int r = 0; r < 3; ++r)
            rows.segment<4>(4 * r) << state.T_W_B.R.row(r).transpose(), state.T_W_B.p(r);
        text += joined(rows, " ") + "\n";
    }
    const std::string times_file = kitti_times_file(file);
    write_text(file, text);
    write_text(times_file, times);
    return times_file;
}

void write_euroc(const std::string& file, const Estimate& estimate) {
    std::string text =
        "#timestamp [ns],p_x [m],p_y [m],p_z [m],q_w [],q_x [],q_y [],q_z [],v_x [m s^-1],"
        "v_y [m s^-1],v_z [m s^-1],b_w_x [rad s^-1],b_w_y [rad s^-1],b_w_z [rad s^-1],"
        "b_a_x [m s^-2],b_a_y [m s^-2],b_a_z [m s^-2]\n";
    for (const StateEstimate& state : estimate.states) {
        text += std::to_string(state.t) + "," + joined(state.T_W_B.p, ",") + "," +
                joined(wxyz(state.T_W_B.R), ",");
        for (const Eigen::Vector3d& v : {state.v_W, state.gyro_bias, state.accel_bias})
            text += "," + joined(v, ",");
        text += "\n";
    }
    write_text(file, text);
}

void write_vrml(const std::string& file, const Estimate& estimate, const Pose& T_B_C) {
    constexpr size_t kMostViewpoints = 50;
    std::string text =
        "#VRML V2.0 utf8\n# Metres in W, z up: landmarks, path of B, the camera's views\n";
    const size_t step = (estimate.states.size() + kMostViewpoints - 1) / kMostViewpoints;
    for (size_t i = 0; i < estimate.states.size(); i += step)
        text += viewpoint(estimate.states[i].T_W_B * T_B_C, format_seconds(estimate.states[i].t));
    if (!estimate.landmarks.empty()) text += vrml_points(estimate);
    if (estimate.states.size() > 1) text += vrml_path(estimate);
    write_text(file, text);
}

}  // namespace vio
