#include "libvio/evaluation/metrics.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

#include "libvio/geometry/alignment.h"

namespace vio {
namespace {

// 95 % quantiles of the chi-square distribution.
constexpr double kChiSquare3 = 7.814727903251179, kChiSquare6 = 12.591587243743977;

/// Steps between poses at abscissae x (increasing).
RelativeError relative_error(const std::vector<PosePair>& aligned, const std::vector<double>& x,
                             double step, double tolerance) {
    std::vector<double> translation, rotation;
    double steps = 0;
    for (size_t i = 0; i + 1 < aligned.size(); ++i) {
        const auto begin = x.begin() + static_cast<std::ptrdiff_t>(i) + 1;
        auto nearest = std::lower_bound(begin, x.end(), x[i] + step);
        if (nearest == x.end() ||
            (nearest != begin && x[i] + step - *std::prev(nearest) <= *nearest - (x[i] + step)))
            --nearest;
        if (std::abs(*nearest - x[i] - step) > tolerance * step) continue;
        const PosePair &a = aligned[i], &b = aligned[static_cast<size_t>(nearest - x.begin())];
        const Pose E =
            (a.truth.inverse() * b.truth).inverse() * (a.estimate.inverse() * b.estimate);
        steps += *nearest - x[i];
        translation.push_back(E.p.norm());
        rotation.push_back(rotation_angle(E.R));
    }
    const double count = std::max(1.0, static_cast<double>(translation.size()));
    return {step, steps / count, statistics(std::move(translation)),
            statistics(std::move(rotation))};
}

/// Adds e^T C^-1 e to the sum; not if C is not positive definite to working precision.
template <int N>
void accumulate_nees(const Eigen::Matrix<double, N, 1>& e, const Eigen::Matrix<double, N, N>& C,
                     double bound, NeesStatistics& sum) {
    const Eigen::LDLT<Eigen::Matrix<double, N, N>> ldlt(C);
    if (!C.allFinite() || !ldlt.isPositive() ||
        ldlt.vectorD().minCoeff() <= 1e-14 * ldlt.vectorD().maxCoeff())
        return;
    const double value = e.dot(ldlt.solve(e));
    sum.dof = N;
    ++sum.count;
    sum.mean += value;
    sum.share_in_95 += value <= bound;
}

}  // namespace

ErrorStatistics statistics(std::vector<double> errors) {
    ErrorStatistics s;
    if (errors.empty()) return s;
    std::sort(errors.begin(), errors.end());
    const size_t n = errors.size();
    const double count = static_cast<double>(n);
    s.count = static_cast<int>(n);
    s.mean = std::accumulate(errors.begin(), errors.end(), 0.0) / count;
    s.rmse =
        std::sqrt(std::inner_product(errors.begin(), errors.end(), errors.begin(), 0.0) / count);
    double variance = 0;
    for (double e : errors) variance += (e - s.mean) * (e - s.mean) / count;
    s.std_dev = std::sqrt(variance);
    s.median = n % 2 ? errors[n / 2] : 0.5 * (errors[n / 2 - 1] + errors[n / 2]);
    s.min = errors.front();
    s.max = errors.back();
    return s;
}

double path_length(const Eigen::Matrix3Xd& points) {
    const Eigen::Index steps = points.cols() - 1;
    if (steps < 1) return 0;
    return (points.rightCols(steps) - points.leftCols(steps)).colwise().norm().sum();
}

double rotation_angle(const Eigen::Matrix3d& R) {
    return so3::log(R).norm();
}

Eigen::Matrix3d mean_rotation(const std::vector<Eigen::Matrix3d>& rotations) {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (const Eigen::Matrix3d& R : rotations) sum += R;
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
    return svd.matrixU() * Eigen::Vector3d(1, 1, sign).asDiagonal() * svd.matrixV().transpose();
}

RelativeError relative_error_over_distance(const std::vector<PosePair>& aligned, double step,
                                           double tolerance) {
    std::vector<double> distance(aligned.size(), 0.0);
    for (size_t i = 1; i < aligned.size(); ++i)
        distance[i] = distance[i - 1] + (aligned[i].truth.p - aligned[i - 1].truth.p).norm();
    return relative_error(aligned, distance, step, tolerance);
}

RelativeError relative_error_over_time(const std::vector<PosePair>& aligned, double step,
                                       double tolerance) {
    std::vector<double> time;
    for (const PosePair& pair : aligned) time.push_back(to_seconds(pair.t - aligned.front().t));
    return relative_error(aligned, time, step, tolerance);
}

WorldTilt world_tilt(const std::vector<PosePair>& pairs, const std::vector<Matrix6d>& covariances) {
    std::vector<Eigen::Matrix3d> R_G_E;
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    for (const PosePair& pair : pairs) {
        const Eigen::Matrix3d& R = pair.estimate.R;
        const Matrix6d& C = covariances.at(static_cast<size_t>(pair.estimate_idx));
        R_G_E.push_back(pair.truth.R * R.transpose());
        covariance += R * C.topLeftCorner<3, 3>() * R.transpose();
    }
    const Eigen::Vector3d up = mean_rotation(R_G_E).col(2);
    const double count = static_cast<double>(std::max<size_t>(1, pairs.size()));
    return {std::atan2(up.head<2>().norm(), up.z()),
            std::sqrt((covariance(0, 0) + covariance(1, 1)) / count)};
}

Nees nees(const std::vector<PosePair>& pairs, const std::vector<Matrix6d>& covariances) {
    Nees result;
    result.position.dof = result.rotation.dof = 3;
    result.pose.dof = 6;
    if (pairs.empty()) return result;
    const Similarity S_G_E = align_yaw_position(pairs.front().estimate, pairs.front().truth);
    const Similarity S_E_G = S_G_E.inverse();
    for (const PosePair& pair : pairs) {
        const Vector6d e = (S_E_G * pair.truth).boxminus(pair.estimate);
        const Matrix6d& C = covariances.at(static_cast<size_t>(pair.estimate_idx));
        accumulate_nees<3>(e.head<3>(), C.topLeftCorner<3, 3>(), kChiSquare3, result.rotation);
        accumulate_nees<3>(e.tail<3>(), C.bottomRightCorner<3, 3>(), kChiSquare3, result.position);
        accumulate_nees<6>(e, C, kChiSquare6, result.pose);
    }
    for (NeesStatistics* s : {&result.position, &result.rotation, &result.pose}) {
        if (s->count == 0) continue;
        s->mean /= s->count;
        s->share_in_95 /= s->count;
    }
    return result;
}

}  // namespace vio
