#include "libvio/io/results.h"

#include <mrpt/maps/CSimpleMap.h>
#include <mrpt/maps/CSimplePointsMap.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/poses/CPose3DPDFGaussian.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <sstream>

#include "libvio/io/calibration_file.h"
#include "libvio/io/landmark_colour.h"
#include "libvio/io/mrpt_conversions.h"
#include "libvio/io/text.h"
#include "libvio/io/trajectory_io.h"

namespace vio {
namespace {

namespace fs = std::filesystem;

std::string path_in(const std::string& folder, const std::string& name) {
    return (fs::path(folder) / name).string();
}

Matrix6d pose_covariance(const StateEstimate& state) {
    return state.covariance.topLeftCorner<6, 6>();
}

double path_length(const Estimate& estimate) {
    double length = 0;
    for (size_t i = 1; i < estimate.states.size(); ++i)
        length += (estimate.states[i].T_W_B.p - estimate.states[i - 1].T_W_B.p).norm();
    return length;
}

std::string covariance_text(const Estimate& estimate) {
    std::string text =
        "# Covariance of each pose T_W_B: t[s], then the upper triangle, row by row, of the 6x6\n"
        "# matrix of (rotation xyz [rad], perturbed on the right, in B; position xyz [m], in W)\n";
    for (const StateEstimate& state : estimate.states) {
        text += format_seconds(state.t);
        for (int r = 0; r < 6; ++r)
            for (int c = r; c < 6; ++c) text += ' ' + format(state.covariance(r, c));
        text += '\n';
    }
    return text;
}

std::string states_text(const Estimate& estimate) {
    std::string text =
        "# Velocity of B's origin and gravity in W, biases in I, each with its 1-sigma.\n# t[s]";
    const auto name = [&](const std::string& quantity, const std::string& unit) {
        for (const char* prefix : {"", "sigma_"})
            for (const char* axis : {"x", "y", "z"})
                text += std::string(",").append(prefix).append(quantity).append(axis).append(unit);
    };
    name("v_", "[m/s]");
    name("gyro_bias_", "[rad/s]");
    name("accel_bias_", "[m/s^2]");
    name("gravity_", "[m/s^2]");
    text += ",lost[0|1],features\n";
    const auto add = [&](const Eigen::Vector3d& value, const Eigen::Vector3d& variance) {
        for (int k = 0; k < 3; ++k) text += ',' + format(value(k));
        for (int k = 0; k < 3; ++k) text += ',' + format(std::sqrt(std::max(0.0, variance(k))));
    };
    const Eigen::Vector3d gravity_variance = estimate.gravity_covariance.diagonal();
    for (const StateEstimate& s : estimate.states) {
        const Eigen::Matrix<double, 15, 1> variance = s.covariance.diagonal();
        text += format_seconds(s.t);
        add(s.v_W, variance.segment<3>(kVelocity));
        add(s.gyro_bias, variance.segment<3>(kGyroBias));
        add(s.accel_bias, variance.segment<3>(kAccelBias));
        add(estimate.g_W, gravity_variance);
        text += std::string(s.lost ? ",1," : ",0,") + std::to_string(s.features) + '\n';
    }
    return text;
}

std::string landmarks_ply(const Estimate& estimate) {
    std::ostringstream out;
    out << "ply\nformat ascii 1.0\n"
           "comment landmarks in W [m]; covariance of the position [m^2]; colour by uncertainty\n"
        << "element vertex " << estimate.landmarks.size() << "\n";
    for (const char* name : {"x", "y", "z"}) out << "property double " << name << "\n";
    for (const char* name : {"red", "green", "blue"}) out << "property uchar " << name << "\n";
    out << "property int id\nproperty int observations\n";
    for (const char* name : {"xx", "xy", "xz", "yy", "yz", "zz"})
        out << "property double covariance_" << name << "\n";
    out << "end_header\n";
    const LandmarkColours colours(estimate.landmarks);
    for (const LandmarkEstimate& l : estimate.landmarks) {
        for (int k = 0; k < 3; ++k) out << format(l.p_W(k)) << ' ';
        out << colours.rgb(l).transpose() << ' ' << l.id << ' ' << l.observations;
        for (int r = 0; r < 3; ++r)
            for (int c = r; c < 3; ++c) out << ' ' << format(l.covariance(r, c));
        out << '\n';
    }
    return out.str();
}

void write_point_map(const std::string& file, const Estimate& estimate) {
    mrpt::maps::CSimplePointsMap map;
    for (const LandmarkEstimate& l : estimate.landmarks)
        map.insertPoint(static_cast<float>(l.p_W.x()), static_cast<float>(l.p_W.y()),
                        static_cast<float>(l.p_W.z()));
    if (!map.save3D_to_text_file(file)) throw InputError(file + ": cannot be written");
}

// MRPT's own writer rounds to micrometres and gives no header; its reader takes both.
std::string interpolator_text(const Estimate& estimate) {
    std::string text = "% T_W_B: t[s] x[m] y[m] z[m] yaw[rad] pitch[rad] roll[rad]\n";
    for (const StateEstimate& state : estimate.states) {
        const auto pose = to_mrpt(state.T_W_B);
        text += format_seconds(state.t);
        for (const double value :
             {pose.x(), pose.y(), pose.z(), pose.yaw(), pose.pitch(), pose.roll()})
            text += ' ' + format(value);
        text += '\n';
    }
    return text;
}

void write_simplemap(const std::string& file, const Results& results) {
    register_mrpt_classes();
    mrpt::maps::CSimpleMap map;
    const auto& states = results.estimate.states;
    for (const FeatureFrame& frame : results.keyframes) {
        const auto state =
            std::lower_bound(states.begin(), states.end(), frame.t,
                             [](const StateEstimate& s, TimeNs t) { return s.t < t; });
        if (state == states.end() || state->t != frame.t) continue;
        auto features = std::make_shared<CObservationFeatures>(to_mrpt(frame));
        features->cameraPose = to_mrpt(results.rig.T_B_C);
        features->cameraParams = to_mrpt(results.rig.camera);
        features->sensorLabel = "camera";
        auto sensors = mrpt::obs::CSensoryFrame::Create();
        sensors->insert(features);
        map.insert(
            mrpt::poses::CPose3DPDFGaussian::Create(to_mrpt(state->T_W_B, pose_covariance(*state))),
            sensors);
    }
    if (!map.saveToFile(file)) throw InputError(file + ": cannot be written");
}

nlohmann::json summary(const Results& results) {
    const Estimate& estimate = results.estimate;
    nlohmann::json json = results.summary;
    json["images"] = estimate.states.size();
    json["landmarks"] = estimate.landmarks.size();
    json["duration_s"] = estimate.states.empty()
                             ? 0.0
                             : to_seconds(estimate.states.back().t - estimate.states.front().t);
    json["path_length_m"] = path_length(estimate);
    json["gravity"] = {estimate.g_W.x(), estimate.g_W.y(), estimate.g_W.z()};
    std::vector<double> covariance;
    for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c) covariance.push_back(estimate.gravity_covariance(r, c));
    json["gravity_covariance"] = covariance;
    json["has_scale"] = estimate.has_scale;
    return json;
}

// Looks up the state of a stamp while both go forward in time.
StateEstimate& state_at(Estimate& estimate, TimeNs t, const TextRows& rows) {
    const auto it =
        std::lower_bound(estimate.states.begin(), estimate.states.end(), t,
                         [](const StateEstimate& s, TimeNs time) { return s.t < time; });
    if (it == estimate.states.end() || it->t != t)
        throw rows.error(
            "no pose of this time in trajectory.tum; the files do not belong together");
    return *it;
}

void read_covariances(const std::string& file, Estimate& estimate) {
    TextRows rows(file);
    while (rows.next()) {
        rows.require(22);
        StateEstimate& state = state_at(estimate, rows.seconds(0), rows);
        size_t field = 1;
        for (int r = 0; r < 6; ++r)
            for (int c = r; c < 6; ++c)
                state.covariance(r, c) = state.covariance(c, r) = rows.number(field++);
    }
}

void read_states(const std::string& file, Estimate& estimate) {
    TextRows rows(file);
    while (rows.next()) {
        rows.require(27);
        StateEstimate& state = state_at(estimate, rows.seconds(0), rows);
        const auto vector = [&](size_t first) {
            return Eigen::Vector3d(rows.number(first), rows.number(first + 1),
                                   rows.number(first + 2));
        };
        const auto variances = [&](int index, size_t first) {
            state.covariance.diagonal().segment<3>(index) = vector(first).cwiseAbs2();
        };
        state.v_W = vector(1);
        variances(kVelocity, 4);
        state.gyro_bias = vector(7);
        variances(kGyroBias, 10);
        state.accel_bias = vector(13);
        variances(kAccelBias, 16);
        state.lost = rows.integer(25) != 0;
        state.features = static_cast<int>(rows.integer(26));
    }
}

void read_ply(const std::string& file, Estimate& estimate) {
    TextRows rows(file);
    while (rows.next() && rows.text(0) != "end_header") continue;
    while (rows.next()) {
        rows.require(14);
        LandmarkEstimate landmark;
        for (int k = 0; k < 3; ++k) landmark.p_W(k) = rows.number(static_cast<size_t>(k));
        landmark.id = rows.integer(6);
        landmark.observations = static_cast<int>(rows.integer(7));
        size_t field = 8;
        for (int r = 0; r < 3; ++r)
            for (int c = r; c < 3; ++c)
                landmark.covariance(r, c) = landmark.covariance(c, r) = rows.number(field++);
        estimate.landmarks.push_back(landmark);
    }
}

void read_summary(const std::string& file, Estimate& estimate) {
    try {
        const auto json = nlohmann::json::parse(read_text(file));
        for (int k = 0; k < 3; ++k) {
            estimate.g_W(k) = json.at("gravity").at(static_cast<size_t>(k));
            for (int c = 0; c < 3; ++c)
                estimate.gravity_covariance(k, c) =
                    json.at("gravity_covariance").at(static_cast<size_t>(3 * k + c));
        }
        estimate.has_scale = json.at("has_scale");
    } catch (const nlohmann::json::exception& e) {
        throw InputError(file + ": " + one_line(e.what()) + "; run the estimator again");
    }
}

}  // namespace

void check_results_folder(const std::string& folder, bool overwrite) {
    std::error_code error;
    if (fs::exists(folder) && !fs::is_directory(folder))
        throw InputError(folder + ": is a file; name a folder for the results");
    fs::create_directories(folder, error);
    if (error)
        throw InputError(folder + ": cannot be made (" + error.message() +
                         "); name a folder that can be written");
    if (!overwrite && fs::exists(path_in(folder, "trajectory.tum")))
        throw InputError(folder + ": holds results already; name another folder or overwrite");
    const std::string probe = path_in(folder, "summary.json.probe");
    write_text(probe, "");
    fs::remove(probe, error);
}

void write_results(const std::string& folder, const Results& results, bool overwrite) {
    check_results_folder(folder, overwrite);
    const Estimate& estimate = results.estimate;
    const auto file = [&](const char* name) { return path_in(folder, name); };
    write_text(file("options.ini"), results.options_ini);
    write_text(file("calibration.ini"), calibration_text(results.rig));
    write_text(file("trajectory_cov.txt"), covariance_text(estimate));
    write_text(file("states.csv"), states_text(estimate));
    write_text(file("landmarks.ply"), landmarks_ply(estimate));
    write_complete(file("landmarks.txt"),
                   [&](const std::string& temporary) { write_point_map(temporary, estimate); });
    write_text(file("trajectory.txt"), interpolator_text(estimate));
    write_complete(file("keyframes.simplemap"),
                   [&](const std::string& temporary) { write_simplemap(temporary, results); });
    write_text(file("summary.json"), summary(results).dump(2) + "\n");
    // Last, since its presence says that the folder holds results.
    write_tum(file("trajectory.tum"), trajectory(estimate), "T_W_B, estimate");
}

Estimate read_results(const std::string& folder) {
    const auto file = [&](const char* name) { return path_in(folder, name); };
    if (!fs::is_directory(folder))
        throw InputError(folder + ": no such folder; name a results folder");
    Estimate estimate;
    for (const TimedPose& pose : read_trajectory(file("trajectory.tum"))) {
        StateEstimate state;
        state.t = pose.t;
        state.T_W_B = pose.T_W_B;
        estimate.states.push_back(state);
    }
    const auto optional = [&](const char* name, void (*read)(const std::string&, Estimate&)) {
        if (fs::exists(file(name))) read(file(name), estimate);
    };
    optional("trajectory_cov.txt", read_covariances);
    optional("states.csv", read_states);
    optional("landmarks.ply", read_ply);
    optional("summary.json", read_summary);
    return estimate;
}

Rig read_results_rig(const std::string& folder) {
    Rig rig;
    const std::string file = path_in(folder, "calibration.ini");
    if (fs::exists(file)) load_calibration(file, rig);
    return rig;
}

std::vector<FeatureFrame> select_keyframes(const std::vector<FeatureFrame>& frames,
                                           double overlap) {
    std::vector<FeatureFrame> keyframes;
    std::set<FeatureId> known;
    for (size_t i = 0; i < frames.size(); ++i) {
        const auto& features = frames[i].features;
        const auto shared =
            std::count_if(features.begin(), features.end(),
                          [&](const FeatureObservation& f) { return known.count(f.feature_id); });
        const bool last = i + 1 == frames.size();
        if (!keyframes.empty() && !last &&
            static_cast<double>(shared) >= overlap * static_cast<double>(known.size()))
            continue;
        keyframes.push_back(frames[i]);
        known.clear();
        for (const FeatureObservation& f : features) known.insert(f.feature_id);
    }
    return keyframes;
}

}  // namespace vio
