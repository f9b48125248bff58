#include "libvio/io/results.h"

#include <Eigen/Dense>
#include <algorithm>
#include <filesystem>

#include "libvio/base/files.h"
#include "libvio/io/calibration_file.h"
#include "libvio/io/ply.h"
#include "libvio/io/results_writer.h"
#include "libvio/io/text.h"
#include "libvio/io/trajectory_io.h"

namespace vio {
namespace {

namespace fs = std::filesystem;

std::string path_in(const std::string& folder, const std::string& name) {
    return (fs::path(folder) / name).string();
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

void read_innovations(const std::string& file, Estimate& estimate) {
    TextRows rows(file);
    while (rows.next()) {
        rows.require(10);
        const auto count = [&](size_t field) { return static_cast<int>(rows.integer(field)); };
        estimate.innovations.push_back({rows.seconds(0), count(1), count(2), count(3), count(4),
                                        rows.number(5), rows.number(6), count(7), rows.number(8),
                                        count(9)});
    }
}

void read_summary(const std::string& file, Estimate& estimate) {
    try {
        const auto json = nlohmann::json::parse(read_text(file));
        const auto& gravity = json.at("gravity");
        const auto& covariance = json.at("gravity_covariance");
        for (size_t k = 0; k < 3; ++k) {
            estimate.g_W(static_cast<Eigen::Index>(k)) = gravity.at(k);
            for (size_t c = 0; c < 3; ++c)
                estimate.gravity_covariance(static_cast<Eigen::Index>(k),
                                            static_cast<Eigen::Index>(c)) =
                    covariance.at(3 * k + c);
        }
        estimate.has_scale = json.at("has_scale");
    } catch (const nlohmann::json::exception& e) {
        throw InputError(file + ": " + one_line(e.what()) + "; run the estimator again");
    }
}

}  // namespace

void check_results_folder(const std::string& folder, bool overwrite) {
    std::error_code error;
    if (is_there(folder) && !is_folder(folder))
        throw InputError(folder + ": is a file; name a folder for the results");
    fs::create_directories(folder, error);
    if (error)
        throw InputError(folder + ": cannot be made (" + error.message() +
                         "); name a folder that can be written");
    if (!overwrite && is_there(path_in(folder, "trajectory.tum")))
        throw InputError(folder +
                         ": holds results already; name another folder or overwrite (--overwrite)");
    const std::string probe = path_in(folder, "summary.json.probe");
    write_text(probe, "");
    fs::remove(probe, error);
}

void write_results(const std::string& folder, const Results& results, bool overwrite) {
    ResultsWriter writer(folder, results.rig, results.options_ini, overwrite);
    for (const FeatureFrame& frame : results.keyframes) writer.add_keyframe(frame);
    writer.add(results.estimate);
    writer.finish(results.summary);
}

Estimate read_results(const std::string& folder) {
    const auto file = [&](const char* name) { return path_in(folder, name); };
    if (!is_folder(folder)) throw InputError(folder + ": no such folder; name a results folder");
    if (!is_there(file("trajectory.tum")))
        throw InputError(folder + ": holds no trajectory.tum; name a results folder");
    Estimate estimate;
    for (const TimedPose& pose : read_trajectory(file("trajectory.tum"))) {
        StateEstimate state;
        state.t = pose.t;
        state.T_W_B = pose.T_W_B;
        estimate.states.push_back(state);
    }
    const auto optional = [&](const char* name, void (*read)(const std::string&, Estimate&)) {
        if (is_there(file(name))) read(file(name), estimate);
    };
    optional("trajectory_cov.txt", read_covariances);
    optional("states.csv", read_states);
    optional("innovations.csv", read_innovations);
    if (is_there(file("landmarks.ply"))) estimate.landmarks = read_ply(file("landmarks.ply"));
    optional("summary.json", read_summary);
    return estimate;
}

Rig read_results_rig(const std::string& folder) {
    Rig rig;
    const std::string file = path_in(folder, "calibration.ini");
    if (is_there(file)) load_calibration(file, rig);
    return rig;
}

}  // namespace vio
