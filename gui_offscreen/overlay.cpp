#include "gui_offscreen/overlay.h"

#include <algorithm>
#include <map>
#include <opencv2/imgproc.hpp>
#include <string>

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

const cv::Scalar kRejected = {70, 60, 240}, kEnded = {170, 170, 170}, kRim = {20, 20, 20};

void draw_cross(cv::Mat& picture, const cv::Point& centre, int radius, int shift,
                const cv::Scalar& color, int thickness) {
    for (const int side : {-1, 1}) {
        const cv::Point arm(radius, side * radius);
        cv::line(picture, centre - arm, centre + arm, color, thickness, cv::LINE_AA, shift);
    }
}

struct Tail {
    std::vector<Eigen::Vector2d> points;  ///< oldest first
    int unseen = 0;                       ///< images since the last of them
};

std::map<FeatureId, Tail> tails_of(const std::vector<FeatureFrame>& frames,
                                   const OverlayOptions& options) {
    const size_t shown = std::min(frames.size(), static_cast<size_t>(options.tail_images) + 1);
    std::map<FeatureId, Tail> tails;
    for (size_t i = frames.size() - shown; i < frames.size(); ++i)
        for (const FeatureObservation& f : frames[i].features) {
            Tail& tail = tails[f.feature_id];
            tail.points.push_back(f.uv_px);
            tail.unseen = static_cast<int>(frames.size() - 1 - i);
        }
    std::erase_if(tails, [&](const auto& t) { return t.second.unseen > options.ended_images; });
    return tails;
}

void draw_tail(cv::Mat& picture, const Tail& tail, const cv::Scalar& color, int scale) {
    const size_t n = tail.points.size();
    for (size_t i = 1; i < n; ++i) {
        // Tails fade towards their end.
        const double strength = 0.35 + 0.65 * static_cast<double>(i) / static_cast<double>(n);
        cv::line(picture, fixed_point(tail.points[i - 1], scale),
                 fixed_point(tail.points[i], scale), strength * color, scale, cv::LINE_AA, kShift);
    }
}

void draw_disc(cv::Mat& picture, const cv::Point& centre, int shift, const cv::Scalar& color,
               int scale) {
    cv::circle(picture, centre, (3 * scale) << shift, kRim, cv::FILLED, cv::LINE_AA, shift);
    cv::circle(picture, centre, (2 * scale) << shift, color, cv::FILLED, cv::LINE_AA, shift);
}

}  // namespace

cv::Mat draw_tracks(const cv::Mat& image, const std::vector<FeatureFrame>& frames,
                    const std::unordered_set<FeatureId>& rejected, const OverlayOptions& options) {
    cv::Mat picture;
    if (image.channels() == 1)
        cv::cvtColor(image, picture, cv::COLOR_GRAY2BGR);
    else
        picture = image.clone();
    const int scale = std::max(options.scale, 1);
    if (scale > 1) cv::resize(picture, picture, {}, scale, scale, cv::INTER_CUBIC);
    if (frames.empty()) return picture;
    picture.convertTo(picture, -1, 0.8);  // the image steps back behind the tracks

    const auto tails = tails_of(frames, options);
    const auto color_of = [&](const auto& entry) {
        const auto& [id, tail] = entry;
        if (tail.unseen > 0) return rejected.contains(id) ? kRejected : kEnded;
        return age_color(static_cast<double>(tail.points.size() - 1) / options.tail_images);
    };
    for (const auto& entry : tails) draw_tail(picture, entry.second, color_of(entry), scale);
    for (const auto& entry : tails) {
        const auto& [id, tail] = entry;
        const cv::Point centre = fixed_point(tail.points.back(), scale);
        if (tail.unseen == 0)
            draw_disc(picture, centre, kShift, color_of(entry), scale);
        else if (rejected.contains(id))
            draw_cross(picture, centre, (3 * scale) << kShift, kShift, kRejected, 2 * scale);
        else
            cv::circle(picture, centre, (3 * scale) << kShift, kEnded, scale, cv::LINE_AA, kShift);
    }
    return picture;
}

void draw_track_key(cv::Mat& picture) {
    constexpr int kFont = cv::FONT_HERSHEY_DUPLEX;
    const double size = std::clamp(picture.rows / 720.0, 0.6, 1.5);
    const int pad = cvRound(8 * size), line = cvRound(26 * size), mark = cvRound(4 * size);
    const std::vector<std::string> words = {"new", "old", "against the motion", "gone"};
    std::vector<int> widths;
    int width = pad;
    for (const std::string& word : words) {
        int below = 0;
        widths.push_back(cv::getTextSize(word, kFont, 0.45 * size, 1, &below).width);
        width += 4 * mark + widths.back() + 2 * pad;
    }
    const cv::Rect panel =
        cv::Rect(pad, picture.rows - pad - line, width, line) & cv::Rect({}, picture.size());
    picture(panel).convertTo(picture(panel), -1, 0.3);
    int x = panel.x + pad + mark;
    const int y = panel.y + panel.height / 2, thickness = std::max(1, cvRound(1.2 * size));
    for (size_t i = 0; i < words.size(); ++i) {
        const cv::Point centre(x, y);
        if (i < 2)
            draw_disc(picture, centre, 0, age_color(static_cast<double>(i)), cvRound(1.5 * size));
        if (i == 2) draw_cross(picture, centre, mark, 0, kRejected, 2 * thickness);
        if (i == 3) cv::circle(picture, centre, mark, kEnded, thickness, cv::LINE_AA);
        cv::putText(picture, words[i], {x + 3 * mark, y + cvRound(5 * size)}, kFont, 0.45 * size,
                    {235, 235, 235}, 1, cv::LINE_AA);
        x += 4 * mark + widths[i] + 2 * pad;
    }
}

}  // namespace vio
