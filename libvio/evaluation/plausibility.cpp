#include "libvio/evaluation/plausibility.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "libvio/base/angles.h"
#include "libvio/evaluation/metrics.h"
#include "libvio/geometry/alignment.h"

namespace vio {
namespace {

// Root mean square distance from the mean: the size of a path.
double extent(const Eigen::Matrix3Xd& points) {
    const Eigen::Vector3d mean = points.rowwise().mean();
    return std::sqrt((points.colwise() - mean).colwise().squaredNorm().mean());
}

}  // namespace

std::optional<std::string> other_unit(const Eigen::Matrix3Xd& p_E, const Eigen::Matrix3Xd& p_G) {
    constexpr double kSameShape = 0.05, kSameFactor = 0.2;
    const Alignment sim3 = align(p_E, p_G, AlignmentKind::kSim3);
    if (sim3.status != AlignmentStatus::kDetermined || p_E.cols() < 4) return std::nullopt;
    Eigen::Matrix3Xd residual = p_G;
    for (Eigen::Index i = 0; i < p_E.cols(); ++i) residual.col(i) -= sim3.S_G_E * p_E.col(i);
    if (std::sqrt(residual.colwise().squaredNorm().mean()) > kSameShape * extent(p_G))
        return std::nullopt;
    struct Unit {
        double factor;
        const char* text;
    };
    for (const Unit& unit : {Unit{1000, "the truth's positions seem to be in millimetres"},
                             {100, "the truth's positions seem to be in centimetres"},
                             {1e-3, "the estimate's positions seem to be in millimetres"}}) {
        const double ratio = sim3.S_G_E.s / unit.factor;
        if (std::abs(ratio - 1) > kSameFactor) continue;
        char text[200];
        std::snprintf(text, sizeof(text),
                      "%s: the truth has the estimate's shape, %.4g times as large; give both in "
                      "metres",
                      unit.text, sim3.S_G_E.s);
        return text;
    }
    return std::nullopt;
}

std::optional<std::string> other_attitude(const std::vector<PosePair>& aligned,
                                          const Eigen::Matrix3d& R_B_T) {
    constexpr double kTurned = 10 * kDegree, kWrong = 30 * kDegree;
    constexpr double kConstant = 5 * kDegree, kSamePlace = 0.1;
    std::vector<Eigen::Matrix3d> turns;  // from the estimate's frame to the truth's
    Eigen::Matrix3Xd p_G(3, static_cast<Eigen::Index>(aligned.size()));
    double angle = 0, distance2 = 0;
    for (const PosePair& pair : aligned) {
        turns.push_back(pair.estimate.R.transpose() * pair.truth.R);
        p_G.col(static_cast<Eigen::Index>(turns.size()) - 1) = pair.truth.p;
        angle += rotation_angle(turns.back()) / static_cast<double>(aligned.size());
        distance2 +=
            (pair.estimate.p - pair.truth.p).squaredNorm() / static_cast<double>(aligned.size());
    }
    if (angle < kTurned) return std::nullopt;
    const Eigen::Matrix3d turn = mean_rotation(turns);
    double rest = 0;
    for (const Eigen::Matrix3d& R : turns)
        rest += rotation_angle(turn.transpose() * R) / static_cast<double>(aligned.size());
    char text[240];
    if (rest < kConstant && rest < angle / 2) {
        const Eigen::Matrix3d R = R_B_T * turn;
        std::snprintf(text, sizeof(text),
                      "the truth's frame is turned against the body's by %.2f deg (beside it they "
                      "differ by %.2f deg on average): tell with --tracked X Y Z %.4f %.4f %.4f",
                      angle / kDegree, rest / kDegree, std::atan2(R(1, 0), R(0, 0)),
                      -std::asin(std::clamp(R(2, 0), -1.0, 1.0)), std::atan2(R(2, 1), R(2, 2)));
        return text;
    }
    if (angle < kWrong || std::sqrt(distance2) > kSamePlace * extent(p_G)) return std::nullopt;
    std::snprintf(text, sizeof(text),
                  "the attitudes differ by %.0f deg on average although the positions agree: check "
                  "the quaternions' order (TUM x y z w, EuRoC w x y z) and direction (body to "
                  "world)",
                  angle / kDegree);
    return text;
}

}  // namespace vio
