#include "libvio/evaluation/association.h"

#include <algorithm>
#include <cstdio>

#include "libvio/base/errors.h"

namespace vio {
namespace {

std::string row_name(const std::string& name, size_t idx, TimeNs t) {
    char text[64];
    std::snprintf(text, sizeof(text), " (row %zu, t = %.6f s): ", idx + 1, to_seconds(t));
    return name + text;
}

}  // namespace

Pose interpolate(const Pose& T_W_B0, const Pose& T_W_B1, double u) {
    return T_W_B0.boxplus(u * T_W_B1.boxminus(T_W_B0));
}

void check_trajectory(const std::vector<TimedPose>& trajectory, const std::string& name) {
    if (trajectory.empty())
        throw InputError(name + ": holds no pose; give a trajectory with at least two");
    for (size_t i = 0; i < trajectory.size(); ++i) {
        const TimedPose& row = trajectory[i];
        if (!row.T_W_B.R.allFinite() || !row.T_W_B.p.allFinite())
            throw InputError(row_name(name, i, row.t) +
                             "the pose holds a value that is not finite; remove the row");
        if ((row.T_W_B.R * row.T_W_B.R.transpose() - Eigen::Matrix3d::Identity()).norm() > 1e-3 ||
            row.T_W_B.R.determinant() < 0)
            throw InputError(row_name(name, i, row.t) +
                             "the attitude is not a rotation; check the order of the columns");
        if (i > 0 && row.t <= trajectory[i - 1].t)
            throw InputError(
                row_name(name, i, row.t) +
                (row.t == trajectory[i - 1].t ? "the time stamp repeats" : "time runs backwards") +
                "; sort the rows by time, one for each");
    }
}

std::vector<PosePair> associate(const std::vector<TimedPose>& estimate,
                                const std::vector<TimedPose>& truth, TimeNs max_gap,
                                TimeNs time_offset) {
    std::vector<PosePair> pairs;
    auto after = truth.begin();  // first row of truth that is not before the estimated pose
    for (size_t i = 0; i < estimate.size(); ++i) {
        const TimeNs t = estimate[i].t + time_offset;
        after = std::find_if(after, truth.end(), [t](const TimedPose& row) { return row.t >= t; });
        if (after == truth.end()) break;
        PosePair pair{static_cast<int>(i), t, estimate[i].T_W_B, after->T_W_B};
        if (after->t != t) {
            if (after == truth.begin()) continue;
            const TimedPose& before = *std::prev(after);
            const TimeNs gap = after->t - before.t;
            if (gap > max_gap) continue;
            pair.truth = interpolate(before.T_W_B, after->T_W_B,
                                     static_cast<double>(t - before.t) / static_cast<double>(gap));
        }
        pairs.push_back(pair);
    }
    return pairs;
}

}  // namespace vio
