#include "libvio/tracking/ray_bundle.h"

#include <cmath>

#include "libvio/geometry/so3.h"

namespace vio {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector4d;
using Eigen::VectorXd;
using Matrix23d = Eigen::Matrix<double, 2, 3>;
using Matrix26d = Eigen::Matrix<double, 2, 6>;
using Matrix34d = Eigen::Matrix<double, 3, 4>;
using Matrix43d = Eigen::Matrix<double, 4, 3>;
using Matrix63d = Eigen::Matrix<double, 6, 3>;

constexpr double kLeastGain = 1e-3;  // of the cost, in an iteration
constexpr int kPointIterations = 3;

// Basis of the tangent space of the unit sphere in four dimensions: the columns of a Householder
// reflection that takes h to the fourth axis.
Matrix43d tangent_basis(const Vector4d& h) {
    Vector4d v = h;
    v[3] += h[3] < 0 ? -1 : 1;
    const double beta = 2 / v.squaredNorm();
    return Matrix43d::Identity() - beta * v * v.head<3>().transpose();
}

Vector4d moved(const Vector4d& h, const Matrix43d& basis, const Vector3d& d) {
    return (h + basis * d).normalized();
}

struct Linearised {
    Vector2d r;
    Vector3d q;
    Matrix23d D;        // dr/dq
    Matrix23d J_point;  // for the steps of the basis
};

Vector3d towards(const Pose& T_W_C, const Vector4d& h) {
    return T_W_C.R.transpose() * (h.head<3>() - h[3] * T_W_C.p);
}

Linearised linearise(const Pose& T_W_C, const RayBundle::Ray& ray, const Vector4d& h,
                     const Matrix43d& basis) {
    Linearised result;
    result.q = towards(T_W_C, h);
    const double norm = std::max(result.q.norm(), 1e-12);
    const Vector3d u = result.q / norm;
    result.r.noalias() = ray.B * u;
    result.D = (ray.B - result.r * u.transpose()) / norm;
    const Matrix23d along = result.D * T_W_C.R.transpose();
    result.J_point = along * basis.topRows<3>() - (along * T_W_C.p) * basis.row(3);
    return result;
}

Matrix26d view_jacobian(const Linearised& l, const Pose& T_W_C, const Vector4d& h) {
    Matrix26d J;
    J << l.D * so3::skew(l.q), -h[3] * (l.D * T_W_C.R.transpose());
    return J;
}

}  // namespace

RayBundle::Ray::Ray(int view, const Vector3d& direction) : view_idx(view), m(direction) {
    B.row(0) = m.unitOrthogonal();
    B.row(1) = m.cross(B.row(0).transpose());
}

double RayBundle::error(const Ray& ray, const Vector4d& h) const {
    const Vector3d u = towards(T_W_C[ray.view_idx], h).normalized();
    return ray.m.dot(u) > 0 ? (u - ray.m).norm() : M_PI;
}

void RayBundle::triangulate(Point& point) const {
    Eigen::Matrix4d A = Eigen::Matrix4d::Zero();
    Vector3d mean = Vector3d::Zero();
    for (const Ray& ray : point.rays) {
        const Pose& T = T_W_C[ray.view_idx];
        Matrix34d along;
        along << T.R.transpose(), -(T.R.transpose() * T.p);
        const Matrix34d M = so3::skew(ray.m) * along;
        A.noalias() += M.transpose() * M;
        mean += T.R * ray.m;
    }
    Vector4d h = Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d>(A).eigenvectors().col(0);
    double ahead = 0;  // of the views; nothing tells the sign of h otherwise
    for (const Ray& ray : point.rays) ahead += ray.m.dot(towards(T_W_C[ray.view_idx], h));
    if (ahead < 0) h = -h;
    if (h[3] < 0) h << mean.normalized(), 0;
    for (int iteration = 0; iteration < kPointIterations; ++iteration) {
        const Matrix43d basis = tangent_basis(h);
        Matrix3d H = Matrix3d::Zero();
        Vector3d g = Vector3d::Zero();
        for (const Ray& ray : point.rays) {
            const Linearised l = linearise(T_W_C[ray.view_idx], ray, h, basis);
            const double weight = 1 / (1 + l.r.squaredNorm() / (scale * scale));
            H.noalias() += weight * l.J_point.transpose() * l.J_point;
            g.noalias() += weight * l.J_point.transpose() * l.r;
        }
        H.diagonal().array() += 1e-6 * H.trace();
        h = moved(h, basis, -H.ldlt().solve(g));
        if (h[3] < 0) h = Vector4d(h[0], h[1], h[2], 0).normalized();
    }
    point.h = h;
}

namespace {

// One linearisation of the whole problem.
class System {
 public:
    explicit System(const RayBundle& bundle)
        : bundle_(bundle), size_(6 * static_cast<int>(bundle.T_W_C.size() - 1)) {
        H_views_ = MatrixXd::Zero(size_, size_);
        g_views_ = VectorXd::Zero(size_);
        points_.reserve(bundle.points.size());
        for (const RayBundle::Point& point : bundle.points) add(point);
    }

    // The views' and the points' steps for this damping; views and points moved by them.
    RayBundle stepped(double damping) const {
        MatrixXd H = H_views_;
        H.diagonal() *= 1 + damping;
        H.diagonal().array() += 1e-12;
        VectorXd g = g_views_;
        std::vector<Matrix3d> inverses;
        inverses.reserve(points_.size());
        for (const PointBlock& block : points_) {
            Matrix3d H_point = block.H;
            H_point.diagonal() *= 1 + damping;
            H_point.diagonal().array() += 1e-9 * block.H.trace() + 1e-12;
            inverses.push_back(H_point.inverse());
            eliminate(block, inverses.back(), H, g);
        }
        const VectorXd d = -H.selfadjointView<Eigen::Lower>().ldlt().solve(g);
        RayBundle result = bundle_;
        for (std::size_t v = 1; v < result.T_W_C.size(); ++v)
            result.T_W_C[v] =
                result.T_W_C[v].boxplus(d.segment<6>(6 * static_cast<Eigen::Index>(v - 1)));
        for (std::size_t i = 0; i < points_.size(); ++i) {
            Vector3d g_point = points_[i].g;
            for (const auto& [at, W] : points_[i].W) g_point += W.transpose() * d.segment<6>(at);
            result.points[i].h =
                moved(bundle_.points[i].h, points_[i].basis, -inverses[i] * g_point);
        }
        return result;
    }

 private:
    struct PointBlock {
        Matrix43d basis;
        Matrix3d H = Matrix3d::Zero();
        Vector3d g = Vector3d::Zero();
        std::vector<std::pair<int, Matrix63d>> W;  // (row of the view, J_view^T J_point)
    };

    void add(const RayBundle::Point& point) {
        PointBlock block;
        block.basis = tangent_basis(point.h);
        for (const RayBundle::Ray& ray : point.rays) {
            const Linearised l = linearise(bundle_.T_W_C[ray.view_idx], ray, point.h, block.basis);
            const double weight = 1 / (1 + l.r.squaredNorm() / (bundle_.scale * bundle_.scale));
            block.H.noalias() += weight * l.J_point.transpose() * l.J_point;
            block.g.noalias() += weight * l.J_point.transpose() * l.r;
            if (ray.view_idx == 0) continue;
            const int at = 6 * (ray.view_idx - 1);
            const Matrix26d J_view = view_jacobian(l, bundle_.T_W_C[ray.view_idx], point.h);
            const Matrix26d weighted = weight * J_view;
            H_views_.block<6, 6>(at, at).noalias() += weighted.transpose() * J_view;
            g_views_.segment<6>(at).noalias() += weighted.transpose() * l.r;
            block.W.emplace_back(at, weighted.transpose() * l.J_point);
        }
        points_.push_back(std::move(block));
    }

    // Schur complement, lower triangle (views of a point's rays are in ascending order).
    static void eliminate(const PointBlock& block, const Matrix3d& H_inverse, MatrixXd& H,
                          VectorXd& g) {
        for (std::size_t i = 0; i < block.W.size(); ++i) {
            const auto& [row, W] = block.W[i];
            const Matrix63d K = W * H_inverse;
            g.segment<6>(row).noalias() -= K * block.g;
            for (std::size_t j = 0; j <= i; ++j)
                H.block<6, 6>(row, block.W[j].first).noalias() -= K * block.W[j].second.transpose();
        }
    }

    const RayBundle& bundle_;
    int size_;
    MatrixXd H_views_;
    VectorXd g_views_;
    std::vector<PointBlock> points_;
};

double cost(const RayBundle& bundle) {
    const double s2 = bundle.scale * bundle.scale;
    double sum = 0;
    for (const RayBundle::Point& point : bundle.points)
        for (const RayBundle::Ray& ray : point.rays) {
            const double e = bundle.error(ray, point.h);
            sum += s2 * std::log1p(e * e / s2);
        }
    return sum;
}

}  // namespace

double RayBundle::minimize(int iterations) {
    double damping = 1e-4, best = cost(*this);
    for (int iteration = 0; iteration < iterations; ++iteration) {
        const System system(*this);
        bool better = false;
        for (int attempt = 0; attempt < 4 && !better; ++attempt) {
            RayBundle next = system.stepped(damping);
            const double c = cost(next);
            better = c < best;
            damping *= better ? 0.1 : 10;
            if (!better) continue;
            const double gain = 1 - c / best;
            best = c;
            *this = std::move(next);
            if (gain < kLeastGain) return best;
        }
        if (!better) break;
    }
    return best;
}

}  // namespace vio
