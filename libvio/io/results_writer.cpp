#include "libvio/io/results_writer.h"

#include <Eigen/Dense>
#include <algorithm>
#include <deque>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "libvio/io/calibration_file.h"
#include "libvio/io/json_text.h"
#include "libvio/io/keyframe_spool.h"
#include "libvio/io/landmark_spool.h"
#include "libvio/io/mrpt_conversions.h"
#include "libvio/io/pose_graph.h"
#include "libvio/io/results.h"
#include "libvio/io/text.h"
#include "libvio/io/trajectory_io.h"

namespace vio {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

// ---- Rows of the path ---------------------------------------------------------------------------

/// A file that is valid after every append.
class GrowingText {
 public:
    GrowingText(const std::string& file, const std::string& header)
        : file_(file), out_(file, std::ios::binary | std::ios::trunc) {
        append(header);
    }
    void append(const std::string& text) {
        out_ << text;
        if (!out_.flush()) throw cannot_write(file_);
    }

 private:
    std::string file_;
    std::ofstream out_;
};

const char* const kCovarianceHeader =
    "# Covariance of each pose T_W_B: t[s], then the upper triangle, row by row, of the 6x6\n"
    "# matrix of (rotation xyz [rad], perturbed on the right, in B; position xyz [m], in W)\n";

std::string covariance_row(const StateEstimate& state) {
    std::string text = format_seconds(state.t);
    for (int r = 0; r < 6; ++r)
        for (int c = r; c < 6; ++c) text += ' ' + format(state.covariance(r, c));
    return text + '\n';
}

std::string states_header() {
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
    return text + ",lost[0|1],features\n";
}

std::string states_row(const StateEstimate& state, const Estimate& of) {
    std::string text = format_seconds(state.t);
    const auto add = [&](const Vector3d& value, const Vector3d& variance) {
        for (int k = 0; k < 3; ++k) text += ',' + format(value(k));
        for (int k = 0; k < 3; ++k) text += ',' + format(std::sqrt(std::max(0.0, variance(k))));
    };
    const Eigen::Matrix<double, 15, 1> variance = state.covariance.diagonal();
    add(state.v_W, variance.segment<3>(kVelocity));
    add(state.gyro_bias, variance.segment<3>(kGyroBias));
    add(state.accel_bias, variance.segment<3>(kAccelBias));
    add(of.g_W, of.gravity_covariance.diagonal());
    return text + (state.lost ? ",1," : ",0,") + std::to_string(state.features) + '\n';
}

// MRPT's own writer rounds to micrometres and gives no header; its reader takes both.
const char* const kInterpolatorHeader =
    "% T_W_B: t[s] x[m] y[m] z[m] yaw[rad] pitch[rad] roll[rad]\n";

std::string interpolator_row(const StateEstimate& state) {
    std::string text = format_seconds(state.t);
    const auto pose = to_mrpt(state.T_W_B);
    for (const double value : {pose.x(), pose.y(), pose.z(), pose.yaw(), pose.pitch(), pose.roll()})
        text += ' ' + format(value);
    return text + '\n';
}

// Of the recursive estimator; the batch has none, and no such file.
const char* const kInnovationsHeader =
    "# What each image told the filter beyond what its state expected; the normalised ones are\n"
    "# r^T S^-1 r, expected: dof.\n"
    "# t[s],landmarks,landmarks_rejected,new_points,new_points_rejected,rms[px],normalised,dof,"
    "readings_normalised,readings_dof\n";

std::string innovations_row(const ImageInnovations& i) {
    std::string text = format_seconds(i.t);
    for (const int count : {i.landmarks, i.landmarks_rejected, i.new_points, i.new_points_rejected})
        text += ',' + std::to_string(count);
    text += ',' + format(i.rms_px) + ',' + format(i.normalised) + ',' + std::to_string(i.dof);
    return text + ',' + format(i.readings_normalised) + ',' + std::to_string(i.readings_dof) + '\n';
}

/// The four files that hold a row for each state, and the one with a row for each innovation.
struct PathFiles {
    explicit PathFiles(const fs::path& folder)
        : poses(folder / "trajectory.tum", tum_header("T_W_B, estimate")),
          covariances(folder / "trajectory_cov.txt", kCovarianceHeader),
          interpolator(folder / "trajectory.txt", kInterpolatorHeader),
          states(folder / "states.csv", states_header()),
          innovations_file(folder / "innovations.csv") {
        fs::remove(innovations_file);
    }

    // Poses first: a row of the others belongs to one of them.
    void append(const Estimate& piece) {
        std::string text[4];
        for (const StateEstimate& state : piece.states) {
            text[0] += tum_row({state.t, state.T_W_B});
            text[1] += covariance_row(state);
            text[2] += interpolator_row(state);
            text[3] += states_row(state, piece);
        }
        poses.append(text[0]);
        covariances.append(text[1]);
        interpolator.append(text[2]);
        states.append(text[3]);
        if (piece.innovations.empty()) return;
        if (!innovations) innovations.emplace(innovations_file, kInnovationsHeader);
        std::string rows;
        for (const ImageInnovations& row : piece.innovations) rows += innovations_row(row);
        innovations->append(rows);
    }

    GrowingText poses, covariances, interpolator, states;
    fs::path innovations_file;
    std::optional<GrowingText> innovations;
};

}  // namespace

struct ResultsWriter::Impl {
    void open();
    void count(const StateEstimate& state);
    void write_waiting_keyframe(const StateEstimate& state);
    void finish_graph();

    fs::path folder;
    Rig rig;
    std::string options_ini;
    std::optional<PathFiles> path;
    std::optional<LandmarkSpool> landmarks;
    std::optional<KeyframeSpool> keyframes;
    std::optional<PoseGraphWriter> graph;
    std::deque<FeatureFrame> waiting;  // key-frames, for their states
    StateEstimate last;
    WrittenPath written;
    Estimate parameters;  // gravity and scale, without states
};

void ResultsWriter::Impl::open() {
    for (const char* name : {"summary.json", "landmarks.ply", "landmarks.txt", "scene.3Dscene",
                             "snapshot.png", "keyframes.simplemap"})
        fs::remove(folder / name);
    write_text(folder / "options.ini", options_ini);
    write_text(folder / "calibration.ini", calibration_text(rig));
    landmarks.emplace(folder / "landmarks.partial");
    keyframes.emplace(folder / "keyframes.partial", rig);
    graph.emplace((folder / "keyframes.graph").string());
    path.emplace(folder);
}

void ResultsWriter::Impl::count(const StateEstimate& state) {
    if (written.poses == 0) written.first = state.t;
    if (written.poses > 0) written.length += (state.T_W_B.p - last.T_W_B.p).norm();
    written.last = state.t;
    written.lost_poses += state.lost;
    ++written.poses;
}

void ResultsWriter::Impl::write_waiting_keyframe(const StateEstimate& state) {
    while (!waiting.empty() && waiting.front().t < state.t) waiting.pop_front();
    if (waiting.empty() || waiting.front().t != state.t) return;
    keyframes->add(waiting.front(), state);
    waiting.pop_front();
}

void ResultsWriter::Impl::finish_graph() {
    const bool any = graph->finish();
    const PoseGraphWriter::LeftOut& left_out = graph->left_out();
    if (left_out.count == 0) return;
    const std::string motions = std::to_string(left_out.count) +
                                " motions between key-frames have no covariance with an inverse, "
                                "the first from " +
                                format_seconds(left_out.from) + " s to " +
                                format_seconds(left_out.to) + " s: ";
    written.shortfalls.emplace_back(left_out.from, "keyframes.graph: " + motions +
                                                       (any ? "it is in pieces, without their edges"
                                                            : "there is no such file"));
}

ResultsWriter::ResultsWriter(const std::string& folder, const Rig& rig,
                             const std::string& options_ini, bool overwrite)
    : impl_(std::make_unique<Impl>()) {
    check_results_folder(folder, overwrite);
    impl_->folder = folder;
    impl_->rig = rig;
    impl_->options_ini = options_ini;
}

ResultsWriter::~ResultsWriter() = default;

void ResultsWriter::set_rig(const Rig& rig) {
    impl_->rig = rig;
}

void ResultsWriter::add(const Estimate& piece) {
    Impl& w = *impl_;
    if (!w.path && piece.states.empty()) return;
    if (!w.path) w.open();
    w.path->append(piece);
    w.graph->add(piece);
    for (const StateEstimate& state : piece.states) {
        w.count(state);
        w.write_waiting_keyframe(state);
        w.last = state;
    }
    for (const LandmarkEstimate& landmark : piece.landmarks) w.landmarks->add(landmark);
    w.parameters.g_W = piece.g_W;
    w.parameters.gravity_covariance = piece.gravity_covariance;
    w.parameters.has_scale = piece.has_scale;
}

void ResultsWriter::add_keyframe(const FeatureFrame& frame) {
    Impl& w = *impl_;
    if (w.written.poses > 0 && frame.t == w.last.t)
        w.keyframes->add(frame, w.last);
    else if (w.written.poses == 0 || frame.t > w.last.t)
        w.waiting.push_back(frame);
}

const WrittenPath& ResultsWriter::written() const {
    return impl_->written;
}

void ResultsWriter::finish(const nlohmann::json& summary) {
    Impl& w = *impl_;
    w.landmarks->close();
    w.landmarks->write(w.folder);
    w.keyframes->finish((w.folder / "keyframes.simplemap").string(), *w.landmarks);
    w.written.landmarks = w.landmarks->count();
    w.landmarks->remove();
    w.finish_graph();
    const Estimate& estimate = w.parameters;
    nlohmann::json json = summary;
    for (const auto& [t, text] : w.written.shortfalls)
        json["events"].push_back({{"t_ns", t}, {"text", text}});
    json["poses"] = w.written.poses;
    json["landmarks"] = w.written.landmarks;
    json["lost_poses"] = w.written.lost_poses;
    json["duration_s"] = to_seconds(w.written.last - w.written.first);
    json["path_length_m"] = w.written.length;
    json["gravity"] = {estimate.g_W.x(), estimate.g_W.y(), estimate.g_W.z()};
    std::vector<double> covariance;
    for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c) covariance.push_back(estimate.gravity_covariance(r, c));
    json["gravity_covariance"] = covariance;
    json["has_scale"] = estimate.has_scale;
    write_text(w.folder / "summary.json", json_text(json));
}

}  // namespace vio
