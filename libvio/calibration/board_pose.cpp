#include "libvio/calibration/board_pose.h"

#include <cmath>
#include <opencv2/calib3d.hpp>
#include <vector>

#include "libvio/base/angles.h"

namespace vio {
namespace {

constexpr size_t kFewestPoints = 6;

struct Sighting {
    Eigen::Vector3d p_W;
    Eigen::Vector2d uv_px;
};

// Gauss-Newton on the pixel distance; false where a point leaves the image.
bool refine(const Camera& camera, const std::vector<Sighting>& seen, Pose& T_C_W, double& rms_px) {
    constexpr int kIterations = 8;
    for (int i = 0;; ++i) {
        Matrix6d H = Matrix6d::Zero();
        Vector6d g = Vector6d::Zero();
        double sum = 0;
        for (const Sighting& s : seen) {
            Matrix23d J_p;
            const auto uv = camera.project(T_C_W * s.p_W, &J_p);
            if (!uv) return false;
            const Eigen::Vector2d r = *uv - s.uv_px;
            sum += r.squaredNorm();
            Eigen::Matrix<double, 2, 6> J;
            J << -J_p * T_C_W.R * so3::skew(s.p_W), J_p;
            H += J.transpose() * J;
            g += J.transpose() * r;
        }
        rms_px = std::sqrt(sum / (2 * static_cast<double>(seen.size())));
        if (i == kIterations) return std::isfinite(rms_px);
        H.diagonal() *= 1 + 1e-6;
        T_C_W = T_C_W.boxplus(Vector6d(-H.ldlt().solve(g)));
    }
}

// A frame V in the middle of the rays' origins, z along their mean direction.
Pose middle_of(const std::vector<Ray>& rays) {
    Pose T_C_V;
    Eigen::Vector3d direction = Eigen::Vector3d::Zero();
    for (const Ray& ray : rays) {
        T_C_V.p += ray.origin / static_cast<double>(rays.size());
        direction += ray.direction;
    }
    T_C_V.R =
        Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), direction).toRotationMatrix();
    return T_C_V;
}

}  // namespace

std::optional<BoardPose> board_pose(const Camera& camera, const FeatureFrame& frame,
                                    const std::map<FeatureId, Fiducial>& board) {
    const double smallest_z = std::cos(80 * kDegree);
    std::vector<Sighting> seen;
    std::vector<Ray> rays;
    for (const FeatureObservation& feature : frame.features) {
        const auto point = board.find(feature.feature_id);
        if (point == board.end()) continue;
        const auto ray = camera.ray(feature.uv_px);
        if (!ray) continue;
        seen.push_back({point->second.p_W, feature.uv_px});
        rays.push_back(*ray);
    }
    if (seen.size() < kFewestPoints) return std::nullopt;
    const Pose T_C_V = middle_of(rays);
    std::vector<cv::Point3d> points;
    std::vector<cv::Point2d> directions;
    for (size_t k = 0; k < seen.size(); ++k) {
        const Eigen::Vector3d d = T_C_V.R.transpose() * rays[k].direction, &p = seen[k].p_W;
        if (d.z() < smallest_z) continue;
        points.emplace_back(p.x(), p.y(), p.z());
        directions.emplace_back(d.x() / d.z(), d.y() / d.z());
    }
    if (points.size() < kFewestPoints) return std::nullopt;
    std::vector<cv::Mat> rotations, translations;
    try {
        cv::solvePnPGeneric(points, directions, cv::Matx33d::eye(), cv::noArray(), rotations,
                            translations, false, cv::SOLVEPNP_SQPNP);
    } catch (const cv::Exception&) {  // points that determine no pose
        return std::nullopt;
    }
    std::optional<BoardPose> best;
    for (size_t k = 0; k < rotations.size(); ++k) {
        const cv::Mat &r = rotations[k], &t = translations[k];
        Pose T_C_W = T_C_V * Pose{so3::exp({r.at<double>(0), r.at<double>(1), r.at<double>(2)}),
                                  {t.at<double>(0), t.at<double>(1), t.at<double>(2)}};
        double rms_px = 0;
        if (!refine(camera, seen, T_C_W, rms_px) || (best && rms_px >= best->rms_px)) continue;
        best = BoardPose{T_C_W.inverse(), static_cast<int>(seen.size()), rms_px};
    }
    return best;
}

}  // namespace vio
