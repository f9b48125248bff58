#include "libvio/calibration/mirror_calibration.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "libvio/base/errors.h"
#include "libvio/base/median.h"
#include "libvio/calibration/board_pose.h"
#include "libvio/geometry/so3.h"

namespace vio {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr int kMirrorUnknowns = 5;  // rotation about two axes, translation

[[noreturn]] void fail(const std::string& problem) {
    throw InputError("mirror calibration: " + problem);
}

struct Unknowns {
    Pose T_C_M;
    std::vector<Pose> T_C_G;  // of each image

    Unknowns moved(const VectorXd& step) const {
        Vector6d mirror = Vector6d::Zero();
        mirror.head<2>() = step.head<2>();
        mirror.tail<3>() = step.segment<3>(2);
        Unknowns next = *this;
        next.T_C_M = T_C_M.boxplus(mirror);
        if (step.size() > kMirrorUnknowns)
            for (size_t k = 0; k < T_C_G.size(); ++k)
                next.T_C_G[k] =
                    T_C_G[k].boxplus(step.segment<6>(kMirrorUnknowns + 6 * static_cast<Index>(k)));
        return next;
    }
};

struct Sighting {
    size_t view_idx;
    FeatureId id;
    Vector3d p_G;
    Vector2d uv_px;
};

class Calibrator {
 public:
    Calibrator(const MirrorCamera& nominal, const std::vector<FeatureFrame>& frames,
               const std::map<FeatureId, Fiducial>& targets,
               const MirrorCalibrationOptions& options)
        : parameters_(nominal.parameters()), options_(options) {
        x_.T_C_M = parameters_.T_C_M;
        if (options.T_G_C && frames.size() != 1)
            fail("the camera's pose can be given for a single image only");
        for (size_t k = 0; k < frames.size(); ++k) {
            Pose T_G_C;
            if (options.T_G_C)
                T_G_C = *options.T_G_C;
            else if (const auto found = board_pose(nominal, frames[k], targets))
                T_G_C = found->T_W_C;
            else
                continue;
            for (const FeatureObservation& f : frames[k].features)
                if (const auto target = targets.find(f.feature_id); target != targets.end())
                    seen_.push_back({x_.T_C_G.size(), f.feature_id, target->second.p_W, f.uv_px});
            x_.T_C_G.push_back(T_G_C.inverse());
            result.views.push_back({k, {}});
        }
        if (x_.T_C_G.empty())
            fail(
                "no image shows six targets in whose places a camera's pose is found; compare "
                "the targets' order and units");
        unknowns_ =
            kMirrorUnknowns + (options.T_G_C ? 0 : 6 * static_cast<Index>(result.views.size()));
        if (2 * static_cast<Index>(seen_.size()) <= unknowns_)
            fail(std::to_string(seen_.size()) + " targets are too few for " +
                 std::to_string(unknowns_) + " unknowns");
    }

    void minimize() {
        double damping = 1e-4;
        cost_ = linearize(x_, true);
        bool converged = false;
        while (!converged && result.iterations < options_.max_iterations) {
            ++result.iterations;
            const VectorXd scale = H_.diagonal().cwiseSqrt();  // radians and metres are not alike
            if (!(scale.minCoeff() > 0)) fail("the targets leave an unknown undetermined");
            const VectorXd inverse = scale.cwiseInverse();
            MatrixXd scaled = inverse.asDiagonal() * H_ * inverse.asDiagonal();
            scaled.diagonal().array() += damping;
            const VectorXd step =
                -inverse.cwiseProduct(scaled.ldlt().solve(inverse.cwiseProduct(gradient_)));
            Unknowns next;
            double cost = std::numeric_limits<double>::infinity();
            try {
                next = x_.moved(step);
                cost = linearize(next, false);
            } catch (const InputError&) {  // a mirror that the camera does not see
            }
            if (cost <= cost_) {
                converged = cost_ - cost <= 1e-10 * cost_ + 1e-20;
                x_ = next;
                cost_ = linearize(x_, true);
                damping = std::max(1e-12, damping / 10);
            } else {
                damping *= 10;
                converged = damping > 1e12;
            }
        }
        if (!converged) fail("the search has not converged; check the targets' order and units");
    }

    // True if there are any. Their limit: of the given spread of the errors, or that of most.
    bool drop_outliers() {
        if (options_.outlier_sigmas <= 0) return false;
        constexpr double kMedianOfNorm = 1.1774;  // of a standard normal vector of two
        std::vector<double> norms;
        for (const Vector2d& r : residuals_) norms.push_back(r.norm());
        const double sigma =
            options_.sigma_px > 0 ? options_.sigma_px : median(norms) / kMedianOfNorm;
        std::vector<Sighting> kept;
        for (size_t k = 0; k < seen_.size(); ++k)
            if (norms[k] <= options_.outlier_sigmas * sigma) kept.push_back(seen_[k]);
        const int dropped = static_cast<int>(seen_.size() - kept.size());
        seen_ = std::move(kept);
        result.outliers += dropped;
        if (2 * static_cast<Index>(seen_.size()) <= unknowns_)
            fail(std::to_string(dropped) + " targets are more than " +
                 std::to_string(static_cast<int>(options_.outlier_sigmas)) +
                 " sigma off, which leaves too few; compare sigma_px, order and places of the "
                 "targets");
        return dropped > 0;
    }

    void publish() {
        if (unseen_ > 0)
            fail(std::to_string(unseen_) + " of " + std::to_string(seen_.size()) +
                 " targets cannot be seen in the mirror; check their places and the camera's pose");
        const double count = 2 * static_cast<double>(seen_.size());
        result.sigma_px = options_.sigma_px > 0
                              ? options_.sigma_px
                              : std::sqrt(cost_ / (count - static_cast<double>(unknowns_)));
        const MatrixXd covariance = result.sigma_px * result.sigma_px * inverse_information();
        constexpr int kPlace[kMirrorUnknowns] = {0, 1, 3, 4, 5};
        for (int i = 0; i < kMirrorUnknowns; ++i)
            for (int j = 0; j < kMirrorUnknowns; ++j)
                result.covariance(kPlace[i], kPlace[j]) = covariance(i, j);
        result.T_C_M = x_.T_C_M;
        for (size_t k = 0; k < result.views.size(); ++k)
            result.views[k].T_G_C = x_.T_C_G[k].inverse();
        result.rms_px = std::sqrt(cost_ / count);
        for (size_t k = 0; k < seen_.size(); ++k)
            result.residuals.push_back({seen_[k].id, seen_[k].uv_px, -residuals_[k]});
    }

    MirrorCalibration result;

 private:
    // Cost at x and residuals, predicted less seen; normal equations too if asked for. A target
    // that is not imaged costs as much as one that is an image's diagonal off; its residual is
    // infinite.
    double linearize(const Unknowns& x, bool equations) {
        MirrorParameters p = parameters_;
        p.T_C_M = x.T_C_M;
        const MirrorCamera camera(p);
        residuals_.assign(seen_.size(), Vector2d::Zero());
        unseen_ = 0;
        double cost = 0;
        if (equations) {
            H_.setZero(unknowns_, unknowns_);
            gradient_.setZero(unknowns_);
        }
        const double diagonal2 =
            camera.width() * camera.width() + camera.height() * camera.height();
        for (size_t k = 0; k < seen_.size(); ++k) {
            const Sighting& s = seen_[k];
            const Pose& T_C_G = x.T_C_G[s.view_idx];
            Matrix23d J_p;
            Eigen::Matrix<double, 2, 6> J_mirror, J_pose;
            const auto uv = camera.project(T_C_G * s.p_G, &J_p, &J_mirror);
            if (!uv) {
                ++unseen_;
                cost += diagonal2;
                residuals_[k].setConstant(std::numeric_limits<double>::infinity());
                continue;
            }
            residuals_[k] = *uv - s.uv_px;
            cost += residuals_[k].squaredNorm();
            if (!equations) continue;
            Eigen::Matrix<double, 2, kMirrorUnknowns> J;
            J << J_mirror.leftCols<2>(), J_mirror.rightCols<3>();
            H_.topLeftCorner<kMirrorUnknowns, kMirrorUnknowns>() += J.transpose() * J;
            gradient_.head<kMirrorUnknowns>() += J.transpose() * residuals_[k];
            if (unknowns_ == kMirrorUnknowns) continue;
            J_pose << -J_p * T_C_G.R * so3::skew(s.p_G), J_p;
            const Index at = kMirrorUnknowns + 6 * static_cast<Index>(s.view_idx);
            H_.block<6, 6>(at, at) += J_pose.transpose() * J_pose;
            H_.block<kMirrorUnknowns, 6>(0, at) += J.transpose() * J_pose;
            H_.block<6, kMirrorUnknowns>(at, 0) += J_pose.transpose() * J;
            gradient_.segment<6>(at) += J_pose.transpose() * residuals_[k];
        }
        return cost;
    }

    MatrixXd inverse_information() const {
        const VectorXd scale = H_.diagonal().cwiseSqrt().cwiseInverse();
        const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scale.asDiagonal() * H_ *
                                                            scale.asDiagonal());
        const VectorXd& values = eigen.eigenvalues();
        if (!(values(0) > 1e-12 * values(values.size() - 1)))
            fail("the targets leave an unknown undetermined; spread them over the image");
        return scale.asDiagonal() * eigen.eigenvectors() * values.cwiseInverse().asDiagonal() *
               eigen.eigenvectors().transpose() * scale.asDiagonal();
    }

    MirrorParameters parameters_;
    const MirrorCalibrationOptions& options_;
    std::vector<Sighting> seen_;
    Index unknowns_ = 0;
    Unknowns x_;
    // At the last call of linearize(); normal equations of the last that asked for them.
    std::vector<Vector2d> residuals_;
    int unseen_ = 0;
    MatrixXd H_;
    VectorXd gradient_;
    double cost_ = 0;
};

}  // namespace

MirrorCalibration calibrate_mirror(const MirrorCamera& nominal,
                                   const std::vector<FeatureFrame>& frames,
                                   const std::map<FeatureId, Fiducial>& targets,
                                   const MirrorCalibrationOptions& options) {
    Calibrator calibrator(nominal, frames, targets, options);
    calibrator.minimize();
    if (calibrator.drop_outliers()) calibrator.minimize();
    calibrator.publish();
    return std::move(calibrator.result);
}

}  // namespace vio
