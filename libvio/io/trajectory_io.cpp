#include "libvio/io/trajectory_io.h"

#include <cmath>

#include "libvio/io/text.h"

namespace vio {
namespace {

// Largest departure of a quaternion from unit length that rounding of text explains.
constexpr double kMaxNormError = 0.01;

// Quaternion whose components stand in the given fields.
Eigen::Matrix3d rotation(const TextRows& row, size_t x, size_t y, size_t z, size_t w) {
    const Eigen::Quaterniond q(row.number(w), row.number(x), row.number(y), row.number(z));
    if (std::abs(q.norm() - 1) > kMaxNormError)
        throw row.error("the quaternion has length " + format(q.norm()) + " instead of 1");
    return q.normalized().toRotationMatrix();
}

TimedPose parse_pose(const TextRows& row) {
    row.require(8);
    TimedPose pose;
    pose.T_W_B.p = {row.number(1), row.number(2), row.number(3)};
    if (row.comma_separated()) {
        pose.t = row.integer(0);
        pose.T_W_B.R = rotation(row, 5, 6, 7, 4);
    } else {
        pose.t = row.seconds(0);
        pose.T_W_B.R = rotation(row, 4, 5, 6, 7);
    }
    return pose;
}

}  // namespace

std::vector<TimedPose> read_trajectory(const std::string& file) {
    TextRows row(file);
    std::vector<TimedPose> poses;
    while (row.next()) {
        const TimedPose pose = parse_pose(row);
        if (!poses.empty() && pose.t <= poses.back().t)
            throw row.error("the time stamp is not later than the one before");
        poses.push_back(pose);
    }
    if (poses.empty())
        throw InputError(file + ": holds no poses; expected TUM text or EuRoC ground truth");
    return poses;
}

std::vector<TimedPose> trajectory(const Estimate& estimate) {
    std::vector<TimedPose> poses;
    for (const StateEstimate& state : estimate.states) poses.push_back({state.t, state.T_W_B});
    return poses;
}

void write_tum(const std::string& file, const std::vector<TimedPose>& poses,
               const std::string& frames) {
    std::string text = "# " + frames + ": t[s] x[m] y[m] z[m] qx qy qz qw\n";
    for (const TimedPose& pose : poses) {
        Eigen::Quaterniond q(pose.T_W_B.R);
        if (q.w() < 0) q.coeffs() *= -1;
        text += format_seconds(pose.t);
        for (int i = 0; i < 3; ++i) text += " " + format(pose.T_W_B.p(i));
        for (int i = 0; i < 4; ++i) text += " " + format(q.coeffs()(i));
        text += "\n";
    }
    write_text(file, text);
}

}  // namespace vio
