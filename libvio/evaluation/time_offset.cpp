#include "libvio/evaluation/time_offset.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vio {
namespace {

constexpr int kCoarseSteps = 100;  // over the whole range
constexpr double kPrecision = 1e-6;

struct Fit {
    double rms = std::numeric_limits<double>::infinity();
    int poses = 0;
};

}  // namespace

std::optional<double> estimate_time_offset(const std::vector<TimedPose>& estimate,
                                           const std::vector<TimedPose>& truth, const Pose& T_B_T,
                                           AlignmentKind kind, TimeNs max_gap, double search_s) {
    const auto fit = [&](double offset) {
        const auto pairs = associate(estimate, truth, max_gap, from_seconds(offset));
        Fit result;
        result.poses = static_cast<int>(pairs.size());
        if (pairs.size() < 3) return result;
        Eigen::Matrix3Xd p_E(3, static_cast<Eigen::Index>(pairs.size())), p_G = p_E;
        for (Eigen::Index i = 0; i < p_E.cols(); ++i) {
            p_E.col(i) = pairs[static_cast<size_t>(i)].estimate * T_B_T.p;
            p_G.col(i) = pairs[static_cast<size_t>(i)].truth.p;
        }
        const Similarity S = align(p_E, p_G, kind).S_G_E;
        double sum = 0;
        for (Eigen::Index i = 0; i < p_E.cols(); ++i)
            sum += (S * p_E.col(i) - p_G.col(i)).squaredNorm();
        result.rms = std::sqrt(sum / static_cast<double>(p_E.cols()));
        // A scaled path fits any truth the better the smaller the truth is: count in its lengths.
        if (kind == AlignmentKind::kSim3) result.rms /= std::max(S.s, 1e-12);
        return result;
    };

    const double step = 2 * search_s / kCoarseSteps;
    std::vector<Fit> fits;
    int most = 0;
    for (int i = 0; i <= kCoarseSteps; ++i) {
        fits.push_back(fit(-search_s + i * step));
        most = std::max(most, fits.back().poses);
    }
    int best = -1;
    for (int i = 0; i <= kCoarseSteps; ++i) {
        const Fit& f = fits[static_cast<size_t>(i)];
        if (f.poses < 3 || 2 * f.poses < most) continue;
        if (best < 0 || f.rms < fits[static_cast<size_t>(best)].rms) best = i;
    }
    if (best <= 0 || best >= kCoarseSteps) return std::nullopt;

    // Golden section in the two steps around the best one.
    const double ratio = (std::sqrt(5.0) - 1) / 2;
    double a = -search_s + (best - 1) * step, b = a + 2 * step;
    double c = b - ratio * (b - a), d = a + ratio * (b - a);
    double at_c = fit(c).rms, at_d = fit(d).rms;
    while (b - a > kPrecision) {
        if (at_c < at_d) {
            b = d, d = c, at_d = at_c;
            c = b - ratio * (b - a), at_c = fit(c).rms;
        } else {
            a = c, c = d, at_c = at_d;
            d = a + ratio * (b - a), at_d = fit(d).rms;
        }
    }
    return (a + b) / 2;
}

}  // namespace vio
