#include "libvio/tracking/two_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "libvio/geometry/so3.h"

namespace vio {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix35d = Eigen::Matrix<double, 3, 5>;
using Vector5d = Eigen::Matrix<double, 5, 1>;
using Matrix5d = Eigen::Matrix<double, 5, 5>;

constexpr int kFewestPairs = 8;

struct Hypothesis {
    Matrix3d R;
    Vector3d t;
};

Eigen::Matrix<double, 3, 2> tangent_basis(const Vector3d& unit) {
    Eigen::Matrix<double, 3, 2> B;
    B.col(0) = unit.unitOrthogonal();
    B.col(1) = unit.cross(B.col(0));
    return B;
}

// Epipolar constraint e = t . (g x f1) with g = R f2, and the length of its gradient with respect
// to the two rays.
struct Constraint {
    Vector3d g, g_cross_f1, f1_cross_t;
    double e, gradient;

    Constraint(const RayPair& pair, const Hypothesis& h)
        : g(h.R * pair.f2), g_cross_f1(g.cross(pair.f1)), f1_cross_t(pair.f1.cross(h.t)) {
        e = h.t.dot(g_cross_f1);
        const double e2 = e * e;
        gradient = std::sqrt(
            std::max(1e-12, (h.t.cross(g).squaredNorm() - e2) + (f1_cross_t.squaredNorm() - e2)));
    }
    // d e / d (right perturbation of R, coordinates of t in its tangent plane)
    Vector5d jacobian(const RayPair& pair, const Hypothesis& h,
                      const Eigen::Matrix<double, 3, 2>& B) const {
        Vector5d J;
        J.head<3>() = pair.f2.cross(h.R.transpose() * f1_cross_t);
        J.tail<2>() = B.transpose() * g_cross_f1;
        return J;
    }
};

Hypothesis moved(const Hypothesis& h, const Vector5d& d, const Eigen::Matrix<double, 3, 2>& B) {
    return {so3::normalized(h.R * so3::exp(d.head<3>())), (h.t + B * d.tail<2>()).normalized()};
}

// Gauss-Newton on the residuals of all pairs, weighted by 1 / (1 + (r/threshold)^2)^2.
Hypothesis refined(const std::vector<RayPair>& pairs, Hypothesis h, double threshold,
                   int iterations) {
    for (int i = 0; i < iterations; ++i) {
        const auto B = tangent_basis(h.t);
        Matrix5d H = Matrix5d::Zero();
        Vector5d b = Vector5d::Zero();
        for (const RayPair& pair : pairs) {
            const Constraint c(pair, h);
            const double r = two_view_residual(pair, h.R, h.t) / threshold;
            const double w = 1 / ((1 + r * r) * (1 + r * r) * c.gradient * c.gradient);
            if (r > 3) continue;
            const Vector5d J = c.jacobian(pair, h, B);
            H.noalias() += w * J * J.transpose();
            b.noalias() -= w * c.e * J;
        }
        // The direction is undetermined without parallax: damping keeps it where it is.
        H.diagonal().array() += 1e-6 * H.trace() + 1e-12;
        const Vector5d d = H.ldlt().solve(b);
        if (!d.allFinite()) break;
        h = moved(h, d, B);
        if (d.norm() < 1e-7) break;
    }
    return h;
}

// Rotation that aligns the sampled rays best (Kabsch).
Matrix3d aligning_rotation(const std::vector<RayPair>& pairs, const std::array<int, 5>& sample) {
    Matrix3d M = Matrix3d::Zero();
    for (const int k : sample) M += pairs[k].f1 * pairs[k].f2.transpose();
    const Eigen::JacobiSVD<Matrix3d> svd(M, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Matrix3d D = Matrix3d::Identity();
    D(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
    return svd.matrixU() * D * svd.matrixV().transpose();
}

class Search {
 public:
    Search(const std::vector<RayPair>& pairs, const TwoViewOptions& options)
        : pairs_(pairs), options_(options), random_(options.seed) {}

    // Best of the hypotheses, polished.
    Hypothesis run(const std::optional<Matrix3d>& R) {
        // A rotation from the gyro may be off by a bias: more room until it has been refined.
        const double room = (R ? 2 : 1) * options_.threshold;
        Hypothesis best{R.value_or(Matrix3d::Identity()), Vector3d::UnitZ()};
        double best_raw_cost = cost(best, room), best_cost = cost(best, options_.threshold);
        int needed = options_.max_hypotheses;
        for (int k = 0; k < std::min(needed, options_.max_hypotheses); ++k) {
            const auto hypothesis = R ? from_two(*R) : from_five();
            if (!hypothesis) continue;
            for (const double sign : {1.0, -1.0}) {
                const Hypothesis h{hypothesis->R, sign * hypothesis->t};
                if (cost(h, room) >= best_raw_cost) continue;
                best_raw_cost = cost(h, room);
                // Noise in the sample costs more than outliers: polish before comparing.
                const Hypothesis polished = refined(pairs_, h, room, 5);
                const double c = cost(polished, options_.threshold);
                if (c >= best_cost) continue;
                best_cost = c;
                best = polished;
                needed = needed_hypotheses(count(polished, room), R ? 2 : 5);
            }
        }
        return refined(pairs_, best, options_.threshold, 20);
    }

    int count(const Hypothesis& h, double threshold) const {
        return static_cast<int>(std::count_if(pairs_.begin(), pairs_.end(), [&](const auto& pair) {
            return two_view_residual(pair, h.R, h.t) < threshold;
        }));
    }

 private:
    double cost(const Hypothesis& h, double threshold) const {
        double sum = 0;
        for (const RayPair& pair : pairs_) {
            const double r = two_view_residual(pair, h.R, h.t) / threshold;
            sum += std::min(1.0, r * r);
        }
        return sum;
    }

    // Enough hypotheses for one without outliers with probability 0.999, three times over since
    // noise spoils some.
    int needed_hypotheses(int inliers, int sample_size) const {
        const double good = std::pow(
            static_cast<double>(inliers) / static_cast<double>(pairs_.size()), sample_size);
        return 1 + static_cast<int>(3 * std::log(1e-3) /
                                    std::log(std::clamp(1 - good, 1e-6, 1 - 1e-6)));
    }

    template <std::size_t N>
    std::array<int, N> sample() {
        std::array<int, N> picked;
        for (std::size_t i = 0; i < N;) {
            picked[i] = static_cast<int>(random_() % pairs_.size());
            if (std::find(picked.begin(), picked.begin() + i, picked[i]) == picked.begin() + i) ++i;
        }
        return picked;
    }

    std::optional<Hypothesis> from_two(const Matrix3d& R) {
        const auto [i, j] = sample<2>();
        const Vector3d ni = (R * pairs_[i].f2).cross(pairs_[i].f1);
        const Vector3d nj = (R * pairs_[j].f2).cross(pairs_[j].f1);
        const Vector3d t = ni.cross(nj);
        const double norm = t.norm();
        if (!(norm > 1e-12)) return std::nullopt;
        return Hypothesis{R, t / norm};
    }

    std::optional<Hypothesis> from_five() {
        const auto picked = sample<5>();
        const Matrix3d R = aligning_rotation(pairs_, picked);
        const Vector3d n0 = (R * pairs_[picked[0]].f2).cross(pairs_[picked[0]].f1);
        const Vector3d n1 = (R * pairs_[picked[1]].f2).cross(pairs_[picked[1]].f1);
        Hypothesis h{R, n0.cross(n1)};
        if (!(h.t.norm() > 1e-14)) return Hypothesis{R, Vector3d::UnitZ()};
        h.t.normalize();
        for (int iteration = 0; iteration < 8; ++iteration) {
            const auto B = tangent_basis(h.t);
            Matrix5d J;
            Vector5d e;
            for (int k = 0; k < 5; ++k) {
                const Constraint c(pairs_[picked[k]], h);
                J.row(k) = c.jacobian(pairs_[picked[k]], h, B).transpose();
                e[k] = c.e;
            }
            const Vector5d d = J.fullPivLu().solve(-e);
            if (!(d.norm() < 2)) return std::nullopt;
            h = moved(h, d, B);
            if (d.norm() < 1e-8) break;
        }
        return h;
    }

    const std::vector<RayPair>& pairs_;
    const TwoViewOptions& options_;
    std::mt19937_64 random_;
};

}  // namespace

double two_view_residual(const RayPair& pair, const Matrix3d& R_C1_C2, const Vector3d& t_C1) {
    const Constraint c(pair, {R_C1_C2, t_C1});
    // d1 f1 = t + d2 g with positive depths moves g away from t.
    if (c.g.dot(t_C1) > pair.f1.dot(t_C1)) return (c.g - pair.f1).norm() * M_SQRT1_2;
    return std::abs(c.e) / c.gradient;
}

std::optional<TwoViewMotion> estimate_two_view(const std::vector<RayPair>& pairs,
                                               const std::optional<Matrix3d>& R_C1_C2,
                                               const TwoViewOptions& options) {
    if (pairs.size() < kFewestPairs) return std::nullopt;
    Search search(pairs, options);
    Hypothesis best = search.run(R_C1_C2);
    int inliers = search.count(best, options.threshold);
    constexpr double kContradicted = 0.2;  // [rad]; few pairs alone may turn by less
    const bool useless =
        R_C1_C2 && (2 * inliers < static_cast<int>(pairs.size()) ||
                    so3::log(R_C1_C2->transpose() * best.R).norm() > kContradicted);
    if (useless) {
        const Hypothesis other = search.run(std::nullopt);
        const int other_inliers = search.count(other, options.threshold);
        if (other_inliers > inliers) {
            best = other;
            inliers = other_inliers;
        }
    }
    TwoViewMotion motion{best.R, best.t, {}, inliers};
    motion.inlier.reserve(pairs.size());
    for (const RayPair& pair : pairs)
        motion.inlier.push_back(two_view_residual(pair, best.R, best.t) < options.threshold);
    return motion;
}

}  // namespace vio
