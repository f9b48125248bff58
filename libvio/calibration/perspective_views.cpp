#include "libvio/calibration/perspective_views.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "libvio/base/angles.h"

namespace vio {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kHalfWidth = 40 * kDegree;  // of a view
constexpr double kSpacing = 25 * kDegree;    // between the middles of neighbouring views
constexpr double kFar = 1e4;                 // [m]
constexpr int kGrey = 128;
constexpr int kSquare_px = 4;

// Directions that the camera sees, no two of them closer than the spacing, and none farther from
// the nearest.
std::vector<Vector3d> directions(const Camera& camera) {
    constexpr int kStep_px = 8;
    const double nearest = std::cos(kSpacing);
    std::vector<Vector3d> chosen;
    for (int v = 0; v < camera.height(); v += kStep_px)
        for (int u = 0; u < camera.width(); u += kStep_px) {
            const auto ray = camera.ray(Vector2d(u, v));
            if (ray && std::none_of(chosen.begin(), chosen.end(), [&](const Vector3d& other) {
                    return other.dot(ray->direction) > nearest;
                }))
                chosen.push_back(ray->direction);
        }
    return chosen;
}

}  // namespace

PerspectiveViews::PerspectiveViews(CameraPtr camera)
    : camera_(std::move(camera)),
      focal_length_px_(1 / camera_->angular_resolution()),
      size_px_(kSquare_px * static_cast<int>(std::ceil(2 * focal_length_px_ * std::tan(kHalfWidth) /
                                                       kSquare_px))) {
    for (const Vector3d& direction : directions(*camera_)) {
        View view;
        view.R_C_V =
            Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), direction).toRotationMatrix();
        views_.push_back(view);
        compute_map(count() - 1);
    }
}

// Exact at the middle of each square of a few pixels, between them linear. Squares that touch what
// is not seen come to lie far outside the image.
void PerspectiveViews::compute_map(int k) {
    constexpr float kNotSeen = -1e6F;
    const int n = size_px_ / kSquare_px;
    cv::Mat x(n, n, CV_32F), y(n, n, CV_32F);
    for (int row = 0; row < n; ++row)
        for (int col = 0; col < n; ++col) {
            const auto middle = [](int square) {
                return static_cast<float>(square * kSquare_px) + 0.5F * (kSquare_px - 1);
            };
            const auto seen = in_image(k, {middle(col), middle(row)});
            x.at<float>(row, col) = seen ? seen->x : kNotSeen;
            y.at<float>(row, col) = seen ? seen->y : kNotSeen;
        }
    cv::resize(x, views_[k].map_x, {size_px_, size_px_}, 0, 0, cv::INTER_LINEAR);
    cv::resize(y, views_[k].map_y, {size_px_, size_px_}, 0, 0, cv::INTER_LINEAR);
}

cv::Mat PerspectiveViews::draw(int k, const cv::Mat& image) const {
    cv::Mat view;
    cv::remap(image, view, views_[k].map_x, views_[k].map_y, cv::INTER_CUBIC, cv::BORDER_CONSTANT,
              cv::Scalar(kGrey));
    return view;
}

std::optional<cv::Point2f> PerspectiveViews::in_image(int k, const cv::Point2f& in_view) const {
    const double middle = (size_px_ - 1) / 2.0;
    const Vector3d p_V((in_view.x - middle) / focal_length_px_,
                       (in_view.y - middle) / focal_length_px_, 1);
    const auto uv = camera_->project(kFar * (views_[k].R_C_V * p_V));
    if (!uv || !camera_->inside_image(*uv) || !camera_->ray(*uv)) return std::nullopt;
    return cv::Point2f(static_cast<float>(uv->x()), static_cast<float>(uv->y()));
}

}  // namespace vio
