#include "gui_offscreen/overlay.h"

#include <algorithm>
#include <map>
#include <opencv2/imgproc.hpp>

namespace vio {
namespace {

/// Blue for a new track to yellow for one as old as the tail.
cv::Scalar age_color(double age) {
    static const std::vector<cv::Scalar> kStops = {
        {255, 150, 60}, {190, 200, 40}, {90, 220, 120}, {30, 215, 250}};
    const double place = std::clamp(age, 0.0, 1.0) * static_cast<double>(kStops.size() - 1);
    const size_t i = std::min(static_cast<size_t>(place), kStops.size() - 2);
    const double u = place - static_cast<double>(i);
    return (1 - u) * kStops[i] + u * kStops[i + 1];
}

constexpr int kShift = 4;  // OpenCV's fixed-point fraction bits, for subpixel positions

cv::Point fixed_point(const Eigen::Vector2d& uv_px, int scale) {
    const Eigen::Vector2d p = (scale * (uv_px.array() + 0.5) - 0.5) * (1 << kShift);
    return {cvRound(p.x()), cvRound(p.y())};
}

}  // namespace

cv::Mat draw_tracks(const cv::Mat& image, const std::vector<FeatureFrame>& frames,
                    const OverlayOptions& options) {
    cv::Mat picture;
    if (image.channels() == 1)
        cv::cvtColor(image, picture, cv::COLOR_GRAY2BGR);
    else
        picture = image.clone();
    const int scale = std::max(options.scale, 1);
    if (scale > 1) cv::resize(picture, picture, {}, scale, scale, cv::INTER_CUBIC);
    if (frames.empty()) return picture;
    picture.convertTo(picture, -1, 0.8);  // the image steps back behind the tracks

    std::map<FeatureId, std::vector<Eigen::Vector2d>> tails;
    const size_t tail = static_cast<size_t>(std::max(options.tail_images, 1));
    for (const FeatureObservation& f : frames.back().features) tails[f.feature_id];
    for (size_t i = frames.size() - std::min(frames.size(), tail + 1); i < frames.size(); ++i)
        for (const FeatureObservation& f : frames[i].features)
            if (const auto it = tails.find(f.feature_id); it != tails.end())
                it->second.push_back(f.uv_px);

    for (const auto& [id, points] : tails) {
        const cv::Scalar color = age_color(static_cast<double>(points.size() - 1) / double(tail));
        for (size_t i = 1; i < points.size(); ++i) {
            // Tails fade towards their end.
            const double strength = 0.35 + 0.65 * static_cast<double>(i) / double(points.size());
            cv::line(picture, fixed_point(points[i - 1], scale), fixed_point(points[i], scale),
                     strength * color, scale, cv::LINE_AA, kShift);
        }
    }
    for (const auto& [id, points] : tails) {
        const cv::Scalar color = age_color(static_cast<double>(points.size() - 1) / double(tail));
        const cv::Point centre = fixed_point(points.back(), scale);
        cv::circle(picture, centre, (3 * scale) << kShift, {20, 20, 20}, cv::FILLED, cv::LINE_AA,
                   kShift);
        cv::circle(picture, centre, (2 * scale) << kShift, color, cv::FILLED, cv::LINE_AA, kShift);
    }
    return picture;
}

}  // namespace vio
