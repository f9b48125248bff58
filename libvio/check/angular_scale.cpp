#include "libvio/check/angular_scale.h"

#include <algorithm>
#include <cmath>

#include "libvio/base/median.h"
#include "libvio/geometry/pose.h"
#include "libvio/geometry/so3.h"

namespace vio {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

constexpr int kFewestViews = 15;       // pairs of images
constexpr int kMostSteps = 20;         // of Gauss-Newton
constexpr double kLongestStep = 0.05;  // of the scale
constexpr double kConverged = 0.1;     // of the scale's sigma
constexpr double kSmallest = 0.5, kLargest = 2;
constexpr double kDifference = 1e-5;  // of the scale, for derivatives
constexpr double kCauchy = 2.4;       // sigmas at which the loss bends
constexpr double kAlike = 4;          // features are seen in many pairs: their errors are alike

// A ray whose angle from the axis is scaled, and how it moves (two directions, at right angles)
// with the ray as stated.
struct ScaledRay {
    Vector3d f, along, around;
};

ScaledRay scaled(const Vector3d& f, double axis, double scale) {
    const double across = f.head<2>().norm(), angle = std::atan2(across, axis * f.z());
    if (across < 1e-9) return {f, Vector3d(scale, 0, 0), Vector3d(0, scale, 0)};
    const Eigen::Vector2d u = f.head<2>() / across;
    const double s = std::sin(scale * angle), c = std::cos(scale * angle);
    return {Vector3d(s * u.x(), s * u.y(), axis * c),
            scale * Vector3d(c * u.x(), c * u.y(), -axis * s),
            s / across * Vector3d(-u.y(), u.x(), 0)};
}

// Sampson's error of a pair in the rays as stated [rad], and its derivative by the rotation (right
// perturbation) and the direction of travel.
struct EpipolarError {
    double e = 0;
    Vector6d J = Vector6d::Zero();
};

std::optional<EpipolarError> epipolar_error(const RayPair& pair, const TwoViewMotion& motion,
                                            double axis, double scale) {
    const ScaledRay a = scaled(pair.f1, axis, scale), b = scaled(pair.f2, axis, scale);
    const Matrix3d& R = motion.R_C1_C2;
    const Vector3d& t = motion.t_C1;
    const Vector3d g = R * b.f, by_f1 = t.cross(g), by_f2 = R.transpose() * a.f.cross(t);
    const double gradient2 = std::pow(by_f1.dot(a.along), 2) + std::pow(by_f1.dot(a.around), 2) +
                             std::pow(by_f2.dot(b.along), 2) + std::pow(by_f2.dot(b.around), 2);
    if (!(gradient2 > 1e-9)) return std::nullopt;  // along the direction of travel
    EpipolarError error;
    error.J << b.f.cross(by_f2), g.cross(a.f);
    error.J /= std::sqrt(gradient2);
    error.e = t.dot(g.cross(a.f)) / std::sqrt(gradient2);
    return error;
}

// Gauss-Newton over the scale and all motions, with Cauchy's loss.
class ScaleFit {
 public:
    ScaleFit(std::vector<RayViews> views, double axis, double finest)
        : views_(std::move(views)), axis_(axis), finest_(finest), sigma_(finest) {}

    std::optional<AngularScale> solve() {
        AngularScale result;
        result.pairs = static_cast<int>(views_.size());
        for (int i = 0; i < kMostSteps; ++i) {
            const double by = step();
            if (!(scale_ > kSmallest && scale_ < kLargest)) return std::nullopt;
            result.scale = scale_;
            result.sigma = sigma_ * std::sqrt(kAlike / information_);
            if (std::abs(by) < kConverged * result.sigma) return result;
        }
        return std::nullopt;
    }

 private:
    // What one pair of images says: normal equations of its motion and of the scale.
    struct Normal {
        Matrix6d H = Matrix6d::Zero();
        Vector6d cross = Vector6d::Zero(), g = Vector6d::Zero();
        double scale = 0, scale_g = 0;
    };

    Normal normal(const RayViews& v, std::vector<double>& errors) const {
        Normal n;
        for (const RayPair& pair : v.pairs) {
            const auto r = epipolar_error(pair, v.motion, axis_, scale_);
            const auto more = epipolar_error(pair, v.motion, axis_, scale_ + kDifference);
            const auto less = epipolar_error(pair, v.motion, axis_, scale_ - kDifference);
            if (!r || !more || !less) continue;
            const double by_scale = (more->e - less->e) / (2 * kDifference);
            const double w = 1 / (1 + std::pow(r->e / (kCauchy * sigma_), 2));
            n.H += w * r->J * r->J.transpose();
            n.cross += w * by_scale * r->J;
            n.g += w * r->e * r->J;
            n.scale += w * by_scale * by_scale;
            n.scale_g += w * r->e * by_scale;
            errors.push_back(std::abs(r->e));
        }
        // The length of t is no unknown, and what nothing tells stays.
        const Vector3d& t = v.motion.t_C1;
        n.H.bottomRightCorner<3, 3>() += (n.H.trace() + 1) * t * t.transpose();
        n.H.diagonal().array() += 1e-6 * n.H.trace();
        return n;
    }

    // Eliminates the motions; returns by how much the scale changed.
    double step() {
        std::vector<Normal> normals;
        std::vector<double> errors;
        for (const RayViews& v : views_) normals.push_back(normal(v, errors));
        double gradient = 0;
        information_ = 0;
        for (const Normal& n : normals) {
            const Vector6d x = n.H.ldlt().solve(n.cross);
            information_ += n.scale - x.dot(n.cross);
            gradient += n.scale_g - x.dot(n.g);
        }
        const double by = std::clamp(-gradient / information_, -kLongestStep, kLongestStep);
        for (std::size_t i = 0; i < views_.size(); ++i) {
            const Normal& n = normals[i];
            const Vector6d d = -n.H.ldlt().solve(n.g + by * n.cross);
            TwoViewMotion& m = views_[i].motion;
            m.R_C1_C2 = m.R_C1_C2 * so3::exp(Vector3d(d.head<3>()));
            m.t_C1 = (m.t_C1 + d.tail<3>()).normalized();
        }
        scale_ += by;
        sigma_ = std::max(1.48 * median(errors), finest_);
        return by;
    }

    std::vector<RayViews> views_;
    double axis_, finest_, scale_ = 1, sigma_, information_ = 0;
};

}  // namespace

std::optional<AngularScale> fit_angular_scale(std::vector<RayViews> views, double axis,
                                              double finest) {
    if (static_cast<int>(views.size()) < kFewestViews) return std::nullopt;
    return ScaleFit(std::move(views), axis, finest).solve();
}

}  // namespace vio
