#include "libvio/io/results_writer.h"

#include <mrpt/io/CFileGZOutputStream.h>
#include <mrpt/io/CFileOutputStream.h>
#include <mrpt/io/CMemoryStream.h>
#include <mrpt/maps/CSimpleMap.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/poses/CPose3DPDFGaussian.h>
#include <mrpt/serialization/CArchive.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cstdio>
#include <deque>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "libvio/io/calibration_file.h"
#include "libvio/io/landmark_colour.h"
#include "libvio/io/mrpt_conversions.h"
#include "libvio/io/pose_graph.h"
#include "libvio/io/results.h"
#include "libvio/io/text.h"
#include "libvio/io/trajectory_io.h"

namespace vio {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

InputError disk_full(const std::string& file) {
    return InputError(file + ": cannot be written; check folder and space");
}

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
        if (!out_.flush()) throw disk_full(file_);
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

/// The four files that hold a row for each state.
struct PathFiles {
    explicit PathFiles(const fs::path& folder)
        : poses(folder / "trajectory.tum", tum_header("T_W_B, estimate")),
          covariances(folder / "trajectory_cov.txt", kCovarianceHeader),
          interpolator(folder / "trajectory.txt", kInterpolatorHeader),
          states(folder / "states.csv", states_header()) {}

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
    }

    GrowingText poses, covariances, interpolator, states;
};

// ---- Landmarks ----------------------------------------------------------------------------------

/// Landmarks on disk in order of arrival; in memory only while they are put in order.
class LandmarkSpool {
 public:
    explicit LandmarkSpool(const std::string& file)
        : file_(file), out_(file, std::ios::binary | std::ios::trunc) {}

    void add(const LandmarkEstimate& landmark) {
        Record r{};
        r.id = landmark.id;
        r.observations = landmark.observations;
        std::copy_n(landmark.p_W.data(), 3, r.p_W);
        int at = 0;
        for (int row = 0; row < 3; ++row)
            for (int col = row; col < 3; ++col) r.covariance[at++] = landmark.covariance(row, col);
        out_.write(reinterpret_cast<const char*>(&r), sizeof r);
        if (!out_) throw disk_full(file_);
    }

    /// landmarks.ply and landmarks.txt, in order of id; returns how many there are.
    int finish(const fs::path& folder) {
        if (!out_.flush()) throw disk_full(file_);
        in_.open(file_, std::ios::binary);
        sort();
        write_complete(folder / "landmarks.ply", [&](const std::string& name) { write_ply(name); });
        write_complete(folder / "landmarks.txt",
                       [&](const std::string& name) { write_text(name); });
        in_.close();
        fs::remove(file_);
        return static_cast<int>(order_.size());
    }

 private:
    struct Record {
        std::int64_t id, observations;
        double p_W[3], covariance[6];
    };
    struct Place {
        FeatureId id;
        std::int64_t record;
    };

    LandmarkEstimate read(std::int64_t record) {
        in_.seekg(record * static_cast<std::int64_t>(sizeof(Record)));
        Record r{};
        if (!in_.read(reinterpret_cast<char*>(&r), sizeof r))
            throw InputError(file_ + ": cannot be read back");
        LandmarkEstimate landmark;
        landmark.id = r.id;
        landmark.observations = static_cast<int>(r.observations);
        landmark.p_W = Vector3d(r.p_W);
        int at = 0;
        for (int row = 0; row < 3; ++row)
            for (int col = row; col < 3; ++col)
                landmark.covariance(row, col) = landmark.covariance(col, row) = r.covariance[at++];
        return landmark;
    }

    // The last record of each id, and the colours.
    void sort() {
        const auto count = static_cast<std::int64_t>(fs::file_size(file_) / sizeof(Record));
        for (std::int64_t i = 0; i < count; ++i) order_.push_back({read(i).id, i});
        std::sort(order_.begin(), order_.end(), [](const Place& a, const Place& b) {
            return std::pair(a.id, -a.record) < std::pair(b.id, -b.record);
        });
        const auto same = [](const Place& a, const Place& b) { return a.id == b.id; };
        order_.erase(std::unique(order_.begin(), order_.end(), same), order_.end());
        std::vector<double> distances;
        for (const Place& place : order_) distances.push_back(read(place.record).p_W.norm());
        colours_ = LandmarkColours(std::move(distances));
    }

    void write_ply(const std::string& name) {
        std::ofstream out(name, std::ios::binary);
        out << "ply\nformat ascii 1.0\n"
               "comment landmarks in W [m]; covariance of the position [m^2]; colour by "
               "uncertainty\n"
            << "element vertex " << order_.size() << "\n";
        for (const char* axis : {"x", "y", "z"}) out << "property double " << axis << "\n";
        for (const char* part : {"red", "green", "blue"}) out << "property uchar " << part << "\n";
        out << "property int id\nproperty int observations\n";
        for (const char* pair : {"xx", "xy", "xz", "yy", "yz", "zz"})
            out << "property double covariance_" << pair << "\n";
        out << "end_header\n";
        for (const Place& place : order_) {
            const LandmarkEstimate l = read(place.record);
            for (int k = 0; k < 3; ++k) out << format(l.p_W(k)) << ' ';
            out << colours_.rgb(l).transpose() << ' ' << l.id << ' ' << l.observations;
            for (int r = 0; r < 3; ++r)
                for (int c = r; c < 3; ++c) out << ' ' << format(l.covariance(r, c));
            out << '\n';
        }
        if (!out.flush()) throw disk_full(name);
    }

    // As mrpt::maps::CSimplePointsMap writes and reads it.
    void write_text(const std::string& name) {
        std::ofstream out(name, std::ios::binary);
        char row[128];
        for (const Place& place : order_) {
            const Eigen::Vector3f p = read(place.record).p_W.cast<float>();
            std::snprintf(row, sizeof row, "%f %f %f\n", double(p.x()), double(p.y()),
                          double(p.z()));
            out << row;
        }
        if (!out.flush()) throw disk_full(name);
    }

    std::string file_;
    std::ofstream out_;
    std::ifstream in_;
    std::vector<Place> order_;
    LandmarkColours colours_{std::vector<double>{}};
};

// ---- Key-frames ---------------------------------------------------------------------------------

/// The elements of a CSimpleMap on disk. MRPT's class holds them all in memory; its serialised form
/// is a head, their number, the elements, and an end mark.
class KeyframeSpool {
 public:
    KeyframeSpool(const std::string& file, const Rig& rig) : file_(file), rig_(rig), out_(file) {
        register_mrpt_classes();
        if (!out_.fileOpenCorrectly()) throw disk_full(file_);
    }

    void add(const FeatureFrame& frame, const StateEstimate& state) {
        auto features = std::make_shared<CObservationFeatures>(to_mrpt(frame));
        features->cameraPose = to_mrpt(rig_.T_B_C);
        features->cameraParams = to_mrpt(rig_.camera);
        features->sensorLabel = "camera";
        mrpt::obs::CSensoryFrame sensors;
        sensors.insert(features);
        const Matrix6d covariance = state.covariance.topLeftCorner<6, 6>();
        auto archive = mrpt::serialization::archiveFrom(out_);
        archive << to_mrpt(state.T_W_B, covariance) << sensors;
        ++count_;
    }

    void finish(const fs::path& folder) {
        out_.close();
        write_complete(folder / "keyframes.simplemap", [&](const std::string& name) {
            if (!write_map(name)) throw disk_full(name);
        });
        fs::remove(file_);
    }

 private:
    bool write_map(const std::string& name) const {
        mrpt::io::CMemoryStream empty;
        mrpt::serialization::archiveFrom(empty) << mrpt::maps::CSimpleMap();
        const auto* bytes = static_cast<const char*>(empty.getRawBufferData());
        const size_t size = empty.getTotalBytesCount();
        constexpr size_t kEnd = 1;
        mrpt::io::CFileGZOutputStream gz;
        if (!gz.open(name)) return false;
        gz.Write(bytes, size - kEnd - sizeof count_);
        gz.Write(&count_, sizeof count_);
        std::ifstream elements(file_, std::ios::binary);
        std::vector<char> chunk(1 << 16);
        while (elements.read(chunk.data(), static_cast<std::streamsize>(chunk.size())),
               elements.gcount() > 0)
            gz.Write(chunk.data(), static_cast<size_t>(elements.gcount()));
        gz.Write(bytes + size - kEnd, kEnd);
        gz.close();
        return true;
    }

    std::string file_;
    Rig rig_;
    mrpt::io::CFileOutputStream out_;
    std::uint32_t count_ = 0;
};

}  // namespace

struct ResultsWriter::Impl {
    void open();
    void count(const StateEstimate& state);
    void write_waiting_keyframe(const StateEstimate& state);

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

ResultsWriter::ResultsWriter(const std::string& folder, const Rig& rig,
                             const std::string& options_ini, bool overwrite)
    : impl_(std::make_unique<Impl>()) {
    check_results_folder(folder, overwrite);
    impl_->folder = folder;
    impl_->rig = rig;
    impl_->options_ini = options_ini;
}

ResultsWriter::~ResultsWriter() = default;

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
    w.written.landmarks = w.landmarks->finish(w.folder);
    w.keyframes->finish(w.folder);
    w.graph->finish();
    const Estimate& estimate = w.parameters;
    nlohmann::json json = summary;
    json["images"] = w.written.poses;
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
    write_text(w.folder / "summary.json", json.dump(2) + "\n");
}

}  // namespace vio
