#include "libvio/camera/mirror_calibration.h"

#include <cmath>
#include <limits>
#include <string>

#include "libvio/base/errors.h"
#include "libvio/geometry/so3.h"

namespace vio {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using Matrix26d = Eigen::Matrix<double, 2, 6>;

constexpr int kMirrorUnknowns = 5;  // rotation about two axes, translation

[[noreturn]] void fail(const std::string& problem) {
    throw InputError("mirror calibration: " + problem);
}

struct Unknowns {
    Pose T_C_M, T_C_G;

    Unknowns moved(const VectorXd& step) const {
        Vector6d mirror = Vector6d::Zero();
        mirror.head<2>() = step.head<2>();
        mirror.tail<3>() = step.segment<3>(2);
        Unknowns next = *this;
        next.T_C_M = T_C_M.boxplus(mirror);
        if (step.size() > kMirrorUnknowns) next.T_C_G = T_C_G.boxplus(step.tail<6>());
        return next;
    }
};

class Problem {
 public:
    Problem(const MirrorCamera& nominal, const std::vector<CalibrationTarget>& targets,
            bool pose_unknown)
        : parameters_(nominal.parameters()),
          targets_(targets),
          unknowns_(kMirrorUnknowns + (pose_unknown ? 6 : 0)) {}

    int unknowns() const { return unknowns_; }

    /// Predicted less seen. A target that is not imaged has no residual, but costs as much as one
    /// that is an image's diagonal off.
    double residuals(const Unknowns& x, VectorXd& r, MatrixXd* J) const {
        MirrorParameters p = parameters_;
        p.T_C_M = x.T_C_M;
        const MirrorCamera camera(p);
        r.setZero(2 * static_cast<Eigen::Index>(targets_.size()));
        unseen_ = 0;
        if (J) J->setZero(r.size(), unknowns_);
        for (std::size_t i = 0; i < targets_.size(); ++i) {
            const Eigen::Index row = 2 * static_cast<Eigen::Index>(i);
            Matrix23d J_p;
            Matrix26d J_mirror;
            const auto uv = camera.project(x.T_C_G * targets_[i].p_G, &J_p, &J_mirror);
            if (!uv) {
                ++unseen_;
                continue;
            }
            r.segment<2>(row) = *uv - targets_[i].uv_px;
            if (!J) continue;
            J->block<2, 2>(row, 0) = J_mirror.leftCols<2>();
            J->block<2, 3>(row, 2) = J_mirror.rightCols<3>();
            if (unknowns_ == kMirrorUnknowns) continue;
            J->block<2, 3>(row, 5) = -J_p * x.T_C_G.R * so3::skew(targets_[i].p_G);
            J->block<2, 3>(row, 8) = J_p;
        }
        const double w = camera.width(), h = camera.height();
        return r.squaredNorm() + unseen_ * (w * w + h * h);
    }

    int unseen() const { return unseen_; }  ///< at the last call of residuals()

 private:
    mutable int unseen_ = 0;
    MirrorParameters parameters_;
    const std::vector<CalibrationTarget>& targets_;
    int unknowns_;
};

// T_C_G for a start: rays d_i, taken as through one viewpoint, and d_i x (R p_i + t) = 0, which is
// linear in R and t.
Pose start_pose(const MirrorCamera& camera, const std::vector<CalibrationTarget>& targets) {
    std::vector<std::pair<Ray, Vector3d>> seen;
    Vector3d viewpoint = Vector3d::Zero(), centre = Vector3d::Zero();
    for (const CalibrationTarget& target : targets)
        if (const auto ray = camera.ray(target.uv_px)) {
            seen.emplace_back(*ray, target.p_G);
            viewpoint += ray->origin;
            centre += target.p_G;
        }
    if (seen.size() < 6)
        fail("fewer than six targets lie on the mirror; give the camera's pose, or more targets");
    const double n = static_cast<double>(seen.size());
    viewpoint /= n;
    centre /= n;
    MatrixXd A(3 * static_cast<Eigen::Index>(seen.size()), 12);
    for (std::size_t i = 0; i < seen.size(); ++i) {
        const Matrix3d D = so3::skew(seen[i].first.direction);
        const Vector3d p = seen[i].second - centre;
        const Eigen::Index row = 3 * static_cast<Eigen::Index>(i);
        for (int k = 0; k < 3; ++k) A.block<3, 3>(row, 3 * k) = p[k] * D;  // columns of R
        A.block<3, 3>(row, 9) = D;
    }
    const Eigen::JacobiSVD<MatrixXd> svd(A, Eigen::ComputeThinV);
    const VectorXd& s = svd.singularValues();
    if (!(s(10) > 1e-3 * s(0)))
        fail("the targets lie in one plane, or nearly; give the camera's pose");
    const VectorXd x = svd.matrixV().col(11);
    const Matrix3d M = Eigen::Map<const Matrix3d>(x.data());
    const double scale = std::cbrt(M.determinant());
    const Eigen::JacobiSVD<Matrix3d> polar(M / scale, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Matrix3d R = polar.matrixU() * polar.matrixV().transpose();
    return {R, x.tail<3>() / scale + viewpoint - R * centre};
}

}  // namespace

MirrorCalibration calibrate_mirror(const MirrorCamera& nominal,
                                   const std::vector<CalibrationTarget>& targets,
                                   const MirrorCalibrationOptions& options) {
    const Problem problem(nominal, targets, !options.T_G_C);
    const int n = problem.unknowns();
    if (2 * static_cast<int>(targets.size()) <= n)
        fail(std::to_string(targets.size()) + " targets are too few for " + std::to_string(n) +
             " unknowns");
    Unknowns x{nominal.parameters().T_C_M,
               options.T_G_C ? options.T_G_C->inverse() : start_pose(nominal, targets)};
    VectorXd r, r_next;
    MatrixXd J;
    double cost = problem.residuals(x, r, &J), damping = 1e-4;
    MirrorCalibration result;
    bool converged = false;
    while (!converged && result.iterations < options.max_iterations) {
        ++result.iterations;
        const MatrixXd H = J.transpose() * J;
        const VectorXd scale = H.diagonal().cwiseSqrt();  // radians and metres are not alike
        if (!(scale.minCoeff() > 0)) fail("the targets leave an unknown undetermined");
        const MatrixXd scaled =
            scale.cwiseInverse().asDiagonal() * H * scale.cwiseInverse().asDiagonal();
        const VectorXd g = scale.cwiseInverse().cwiseProduct(J.transpose() * r);
        const MatrixXd damped = scaled + damping * MatrixXd::Identity(n, n);
        const VectorXd step = -scale.cwiseInverse().cwiseProduct(damped.ldlt().solve(g));
        Unknowns next;
        double next_cost = std::numeric_limits<double>::infinity();
        try {
            next = x.moved(step);
            next_cost = problem.residuals(next, r_next, nullptr);
        } catch (const InputError&) {  // a mirror that the camera does not see
        }
        if (next_cost <= cost) {
            converged = cost - next_cost <= 1e-10 * cost + 1e-20;
            x = next;
            cost = problem.residuals(x, r, &J);
            damping = std::max(1e-12, damping / 10);
        } else {
            damping *= 10;
            converged = damping > 1e12;
        }
    }
    if (!converged) fail("the search has not converged; check the targets' order and units");
    if (problem.unseen() > 0)
        fail(std::to_string(problem.unseen()) + " of " + std::to_string(targets.size()) +
             " targets cannot be seen in the mirror; check their places and the camera's pose");

    const double freedom = static_cast<double>(r.size() - n);
    result.sigma_px = options.sigma_px > 0 ? options.sigma_px : std::sqrt(cost / freedom);
    const MatrixXd H = J.transpose() * J;
    const VectorXd scale = H.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scale.asDiagonal() * H *
                                                        scale.asDiagonal());
    if (!(eigen.eigenvalues()(0) > 1e-12 * eigen.eigenvalues()(n - 1)))
        fail("the targets leave an unknown undetermined; spread them over the image");
    const MatrixXd covariance = result.sigma_px * result.sigma_px * scale.asDiagonal() *
                                eigen.eigenvectors() *
                                eigen.eigenvalues().cwiseInverse().asDiagonal() *
                                eigen.eigenvectors().transpose() * scale.asDiagonal();
    const int place[kMirrorUnknowns] = {0, 1, 3, 4, 5};
    for (int i = 0; i < kMirrorUnknowns; ++i)
        for (int j = 0; j < kMirrorUnknowns; ++j)
            result.covariance(place[i], place[j]) = covariance(i, j);
    result.T_C_M = x.T_C_M;
    result.T_G_C = x.T_C_G.inverse();
    result.rms_px = std::sqrt(cost / static_cast<double>(r.size()));
    for (Eigen::Index i = 0; i < r.size(); i += 2) result.residuals_px.push_back(-r.segment<2>(i));
    return result;
}

}  // namespace vio
