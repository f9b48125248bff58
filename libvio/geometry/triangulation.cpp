#include "libvio/geometry/triangulation.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace vio {
namespace {

struct Normal {
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
};

// Sum over lines of w (I - d d^T) (X - o): the squared distances to the lines, weighted.
Normal normal_equations(const std::vector<SightLine>& lines, const Eigen::Vector3d* at) {
    Normal n;
    for (const SightLine& line : lines) {
        const Eigen::Matrix3d P =
            Eigen::Matrix3d::Identity() - line.direction * line.direction.transpose();
        const double weight = at ? 1 / std::max(1e-12, (*at - line.origin).squaredNorm()) : 1.0;
        n.A += weight * P;
        n.b += weight * (P * line.origin);
    }
    return n;
}

}  // namespace

std::optional<Triangulation> triangulate(const std::vector<SightLine>& lines, double sigma) {
    if (lines.size() < 2) return std::nullopt;
    Triangulation result;
    double smallest_cosine = 1;
    for (const SightLine& line : lines)
        smallest_cosine = std::min(smallest_cosine, line.direction.dot(lines.front().direction));
    result.parallax = std::acos(std::clamp(smallest_cosine, -1.0, 1.0));

    // Distance to a line divided by the range is the angle: reweighting by 1/range^2 turns the
    // linear problem into the angular one.
    Normal n = normal_equations(lines, nullptr);
    constexpr int kIterations = 4;
    for (int i = 0; i < kIterations; ++i) {
        const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(n.A, Eigen::EigenvaluesOnly);
        if (!(eigen.eigenvalues()(0) > 1e-12 * eigen.eigenvalues()(2))) return std::nullopt;
        result.point = n.A.ldlt().solve(n.b);
        if (!result.point.allFinite()) return std::nullopt;
        n = normal_equations(lines, &result.point);
    }
    for (const SightLine& line : lines)
        if ((result.point - line.origin).dot(line.direction) <= 0) return std::nullopt;
    result.covariance = sigma * sigma * n.A.ldlt().solve(Eigen::Matrix3d::Identity());
    return result;
}

}  // namespace vio
