#include "libvio/io/trajectory_io.h"

#include <cmath>
#include <filesystem>
#include <optional>

#include "libvio/base/files.h"
#include "libvio/io/text.h"

namespace vio {
namespace {

// Largest departure of a rotation from unit length that rounding of text explains.
constexpr double kMaxNormError = 0.01;

enum class Layout { kTum, kEuroc, kMrpt, kKitti };

// Quaternion whose components stand in the given fields.
Eigen::Matrix3d rotation(const TextRows& row, size_t x, size_t y, size_t z, size_t w) {
    const Eigen::Quaterniond q(row.number(w), row.number(x), row.number(y), row.number(z));
    if (std::abs(q.norm() - 1) > kMaxNormError)
        throw row.error("the quaternion has length " + format(q.norm()) + " instead of 1");
    return q.normalized().toRotationMatrix();
}

Layout layout_of(const TextRows& row) {
    if (row.comma_separated()) {
        row.require(8);
        return Layout::kEuroc;
    }
    if (row.size() == 7) return Layout::kMrpt;
    if (row.size() == 12) return Layout::kKitti;
    row.require(8);
    return Layout::kTum;
}

Pose parse_kitti(const TextRows& row) {
    Pose T;
    for (int r = 0; r < 3; ++r) {
        const size_t first = 4 * static_cast<size_t>(r);
        for (int c = 0; c < 3; ++c) T.R(r, c) = row.number(first + static_cast<size_t>(c));
        T.p(r) = row.number(first + 3);
    }
    if ((T.R * T.R.transpose() - Eigen::Matrix3d::Identity()).norm() > kMaxNormError ||
        T.R.determinant() < 0)
        throw row.error("the first three columns of the 3x4 matrix are no rotation");
    T.R = Eigen::Quaterniond(T.R).normalized().toRotationMatrix();
    return T;
}

// The stamp of KITTI's poses is in another file: 0 here.
TimedPose parse_pose(const TextRows& row, Layout layout) {
    if (layout_of(row) != layout) throw row.error("the row has another layout than the first");
    TimedPose pose;
    if (layout == Layout::kKitti) return {0, parse_kitti(row)};
    pose.t = layout == Layout::kEuroc ? row.integer(0) : row.seconds(0);
    pose.T_W_B.p = {row.number(1), row.number(2), row.number(3)};
    if (layout == Layout::kEuroc) pose.T_W_B.R = rotation(row, 5, 6, 7, 4);
    if (layout == Layout::kTum) pose.T_W_B.R = rotation(row, 4, 5, 6, 7);
    if (layout == Layout::kMrpt)
        pose.T_W_B.R = (Eigen::AngleAxisd(row.number(4), Eigen::Vector3d::UnitZ()) *
                        Eigen::AngleAxisd(row.number(5), Eigen::Vector3d::UnitY()) *
                        Eigen::AngleAxisd(row.number(6), Eigen::Vector3d::UnitX()))
                           .toRotationMatrix();
    return pose;
}

// Times of KITTI's poses: NAME.times.txt beside NAME.txt, or times.txt.
void add_kitti_times(const std::string& file, std::vector<TimedPose>& poses) {
    namespace fs = std::filesystem;
    fs::path times = kitti_times_file(file);
    if (!is_there(times)) times = fs::path(file).parent_path() / "times.txt";
    if (!is_there(times))
        throw InputError(file + ": KITTI poses carry no time; put the times beside them as " +
                         fs::path(kitti_times_file(file)).filename().string() + " or times.txt");
    TextRows row(times.string());
    size_t i = 0;
    for (; row.next(); ++i) {
        if (i < poses.size()) poses[i].t = row.seconds(0);
        if (i > 0 && i < poses.size() && poses[i].t <= poses[i - 1].t)
            throw row.error("the time is not later than the one before");
    }
    if (i != poses.size())
        throw InputError(file + ": holds " + std::to_string(poses.size()) + " poses, " +
                         times.string() + " " + std::to_string(i) + " times; give one for each");
}

}  // namespace

std::string kitti_times_file(const std::string& poses_file) {
    return std::filesystem::path(poses_file).replace_extension(".times.txt").string();
}

std::vector<TimedPose> read_trajectory(const std::string& file) {
    TextRows row(file);
    std::vector<TimedPose> poses;
    std::optional<Layout> layout;
    while (row.next()) {
        if (!layout) layout = layout_of(row);
        const TimedPose pose = parse_pose(row, *layout);
        if (*layout != Layout::kKitti && !poses.empty() && pose.t <= poses.back().t)
            throw row.error(
                "the time stamp is not later than the one before; sort the rows by time");
        poses.push_back(pose);
    }
    if (poses.empty())
        throw InputError(file + ": holds no poses; expected TUM, EuRoC, KITTI or MRPT text");
    if (*layout == Layout::kKitti) add_kitti_times(file, poses);
    return poses;
}

std::vector<TimedPose> trajectory(const Estimate& estimate) {
    std::vector<TimedPose> poses;
    for (const StateEstimate& state : estimate.states) poses.push_back({state.t, state.T_W_B});
    return poses;
}

std::string tum_header(const std::string& frames) {
    return "# " + frames + ": t[s] x[m] y[m] z[m] qx qy qz qw\n";
}

std::string tum_row(const TimedPose& pose) {
    Eigen::Quaterniond q(pose.T_W_B.R);
    if (q.w() < 0) q.coeffs() *= -1;
    std::string text = format_seconds(pose.t);
    for (int i = 0; i < 3; ++i) text += " " + format(pose.T_W_B.p(i));
    for (int i = 0; i < 4; ++i) text += " " + format(q.coeffs()(i));
    return text + "\n";
}

void write_tum(const std::string& file, const std::vector<TimedPose>& poses,
               const std::string& frames) {
    std::string text = tum_header(frames);
    for (const TimedPose& pose : poses) text += tum_row(pose);
    write_text(file, text);
}

}  // namespace vio
