#include "libvio/io/pose_graph.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <optional>

#include "libvio/io/mrpt_conversions.h"
#include "libvio/io/text.h"

namespace vio {
namespace {

// MRPT's (x, y, z, yaw, pitch, roll); the file's angles stand in the order roll, pitch, yaw.
constexpr std::array<int, 6> kFileOrder = {0, 1, 2, 5, 4, 3};

std::optional<Matrix6d> information(const RelativeMotion& motion) {
    const Matrix6d J = mrpt_tangent_jacobian(motion.T_A_B);
    const Matrix6d covariance = J * motion.covariance * J.transpose();
    // Metres and radians may differ by orders of magnitude: scaled to unit diagonal.
    const Vector6d variances = covariance.diagonal();
    if (!covariance.allFinite() || !(variances.minCoeff() > 0)) return std::nullopt;
    const Vector6d scale = variances.cwiseSqrt().cwiseInverse();
    const Eigen::LLT<Matrix6d> llt(scale.asDiagonal() * covariance * scale.asDiagonal());
    if (llt.info() != Eigen::Success) return std::nullopt;
    return scale.asDiagonal() * llt.solve(Matrix6d::Identity()) * scale.asDiagonal();
}

std::string row_text(const Pose& T) {
    const auto pose = to_mrpt(T);
    std::string text;
    for (const double value : {pose.x(), pose.y(), pose.z(), pose.roll(), pose.pitch(), pose.yaw()})
        text += ' ' + format(value);
    return text;
}

}  // namespace

struct PoseGraphWriter::Impl {
    bool place(const Estimate& piece, TimeNs t, TimedPose& out) const;
    void keep(const TimedPose& keyframe, bool written);
    void write(const std::string& text);

    std::string file, temporary;
    std::ofstream out;
    int id = -1;           // of the last node that was written
    TimedPose node, last;  // last key-frame, last state
    bool any_node = false, node_written = false, any_state = false, any_edge = false;
    LeftOut left_out;
};

bool PoseGraphWriter::Impl::place(const Estimate& piece, TimeNs t, TimedPose& found) const {
    if (any_node && node.t == t) return found = node, true;
    const auto state =
        std::lower_bound(piece.states.begin(), piece.states.end(), t,
                         [](const StateEstimate& s, TimeNs time) { return s.t < time; });
    if (state != piece.states.end() && state->t == t) return found = {t, state->T_W_B}, true;
    if (any_state && last.t == t) return found = last, true;
    return false;
}

void PoseGraphWriter::Impl::keep(const TimedPose& keyframe, bool written) {
    node = keyframe;
    any_node = true;
    node_written = written;
}

void PoseGraphWriter::Impl::write(const std::string& text) {
    out << text;
    if (!out.flush()) throw cannot_write(file);
}

PoseGraphWriter::PoseGraphWriter(const std::string& file) : impl_(std::make_unique<Impl>()) {
    impl_->file = file;
    impl_->temporary = file + ".partial";
    impl_->out.open(impl_->temporary, std::ios::trunc);
    std::filesystem::remove(file);
    impl_->write(
        "# Key-frames: T_W_B as id x y z [m] roll pitch yaw [rad]; motions between them: from to, "
        "T_A_B, information\n");
}

PoseGraphWriter::~PoseGraphWriter() = default;

void PoseGraphWriter::add(const Estimate& piece) {
    Impl& g = *impl_;
    const auto add_node = [&](const TimedPose& node) {
        g.keep(node, true);
        g.write("VERTEX3 " + std::to_string(++g.id) + row_text(node.T_W_B) + '\n');
        if (g.id == 0) g.write("FIX 0\n");
    };
    for (const RelativeMotion& motion : piece.keyframe_motions) {
        TimedPose from, to;
        const bool placed = g.place(piece, motion.from, from) && g.place(piece, motion.to, to);
        const auto inverse = information(motion);
        if (!placed || !inverse) {
            if (g.left_out.count++ == 0) g.left_out = {1, motion.from, motion.to};
            if (placed) g.keep(to, false);  // where the next motion begins
            continue;
        }
        if (!g.node_written || g.node.t != from.t) add_node(from);
        add_node(to);
        g.any_edge = true;
        std::string edge = "EDGE3 " + std::to_string(g.id - 1) + ' ' + std::to_string(g.id) +
                           row_text(motion.T_A_B);
        for (size_t r = 0; r < 6; ++r)
            for (size_t c = r; c < 6; ++c)
                edge += ' ' + format((*inverse)(kFileOrder[r], kFileOrder[c]));
        g.write(edge + '\n');
    }
    if (piece.states.empty()) return;
    g.last = {piece.states.back().t, piece.states.back().T_W_B};
    g.any_state = true;
}

bool PoseGraphWriter::finish() {
    Impl& g = *impl_;
    g.out.close();
    if (g.any_edge)
        std::filesystem::rename(g.temporary, g.file);
    else
        std::filesystem::remove(g.temporary);
    return g.any_edge;
}

const PoseGraphWriter::LeftOut& PoseGraphWriter::left_out() const {
    return impl_->left_out;
}

void write_pose_graph(const std::string& file, const Estimate& estimate) {
    PoseGraphWriter writer(file);
    writer.add(estimate);
    if (!writer.finish()) throw InputError(file + ": no covariance of a motion between key-frames");
}

}  // namespace vio
