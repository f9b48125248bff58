#include "app/painter.h"

#include <algorithm>
#include <cmath>

namespace vio::app {
namespace {

constexpr size_t kMostWaiting = 32;  // images
constexpr long kForgetEvery = 256;   // images

// Between the four pixels around a place inside the image.
Eigen::Vector3f interpolated(const cv::Mat& bgr, const Eigen::Vector2d& uv_px) {
    const int x = static_cast<int>(std::floor(uv_px.x())), y = static_cast<int>(uv_px.y());
    const auto fx = static_cast<float>(uv_px.x() - x), fy = static_cast<float>(uv_px.y() - y);
    const auto at = [&](int column, int row) {
        const int c = std::min(column, bgr.cols - 1), r = std::min(row, bgr.rows - 1);
        if (bgr.channels() == 1)
            return Eigen::Vector3f(Eigen::Vector3f::Constant(bgr.at<std::uint8_t>(r, c)));
        const auto& pixel = bgr.at<cv::Vec3b>(r, c);
        return Eigen::Vector3f(pixel[0], pixel[1], pixel[2]);
    };
    return (1 - fy) * ((1 - fx) * at(x, y) + fx * at(x + 1, y)) +
           fy * ((1 - fx) * at(x, y + 1) + fx * at(x + 1, y + 1));
}

}  // namespace

void Painter::add(const ImageMessage& image) {
    waiting_.push_back(image);
    if (waiting_.size() > kMostWaiting) waiting_.pop_front();
}

void Painter::add(const FeatureFrame& frame) {
    while (!waiting_.empty() && waiting_.front().t < frame.t) waiting_.pop_front();
    if (waiting_.empty() || waiting_.front().t != frame.t) return;
    const ImageMessage& message = waiting_.front();
    const cv::Mat& image = message.colour.empty() ? message.image : message.colour;
    for (const FeatureObservation& feature : frame.features) {
        const Eigen::Vector2d& uv = feature.uv_px;
        if (!(uv.minCoeff() >= 0 && uv.x() <= image.cols - 1 && uv.y() <= image.rows - 1)) continue;
        Colour& colour = colours_[feature.feature_id];
        colour.sum += interpolated(image, uv);
        ++colour.count;
        colour.last_frame = frames_;
    }
    waiting_.pop_front();
    if (++frames_ % kForgetEvery == 0)
        std::erase_if(colours_, [&](const auto& colour) {
            return colour.second.last_frame < frames_ - memory_images_;
        });
}

void Painter::paint(std::vector<LandmarkEstimate>& landmarks) const {
    for (LandmarkEstimate& landmark : landmarks) {
        const auto found = colours_.find(landmark.id);
        if (found == colours_.end()) continue;
        const Eigen::Vector3f bgr = found->second.sum / static_cast<float>(found->second.count);
        landmark.rgb.emplace();
        for (int k = 0; k < 3; ++k)
            (*landmark.rgb)[static_cast<size_t>(k)] =
                static_cast<std::uint8_t>(std::lround(bgr(2 - k)));
    }
}

}  // namespace vio::app
