#include "libvio/simulation/contact_sheet.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace vio {
namespace {

constexpr int kHeight = 240, kImageWidth = 400, kPanelWidth = 280, kCaption = 22;

void write(cv::Mat& picture, const std::string& text, cv::Point at, double size = 0.4) {
    cv::putText(picture, text, at, cv::FONT_HERSHEY_SIMPLEX, size, cv::Scalar(0), 1, cv::LINE_AA);
}

// The image scaled to fit, in the middle.
void place(const cv::Mat& image, cv::Mat panel) {
    const double scale = std::min(static_cast<double>(panel.cols) / image.cols,
                                  static_cast<double>(panel.rows) / image.rows);
    cv::Mat fitted;
    cv::resize(image, fitted, {}, scale, scale, cv::INTER_AREA);
    const cv::Rect where((panel.cols - fitted.cols) / 2, (panel.rows - fitted.rows) / 2,
                         fitted.cols, fitted.rows);
    fitted.copyTo(panel(where));
}

// Largest of 1, 2, 5 times a power of ten below the limit.
double round_length(double limit) {
    const double decade = std::pow(10, std::floor(std::log10(limit)));
    for (const double digit : {5.0, 2.0})
        if (digit * decade <= limit) return digit * decade;
    return decade;
}

std::string in_metres(double length) {
    char text[32];
    if (length < 1)
        std::snprintf(text, sizeof text, "%g cm", 100 * length);
    else
        std::snprintf(text, sizeof text, "%g m", length);
    return text;
}

// The path in the plane of two axes of W.
void draw_path(const std::vector<StateEstimate>& truth, int across, int up,
               const std::string& title, cv::Mat panel) {
    Eigen::Vector2d low(1e18, 1e18), high = -low;
    for (const StateEstimate& state : truth) {
        const Eigen::Vector2d p(state.T_W_B.p[across], state.T_W_B.p[up]);
        low = low.cwiseMin(p);
        high = high.cwiseMax(p);
    }
    const Eigen::Vector2d middle = (low + high) / 2, extent = (high - low).cwiseMax(0.02);
    const double scale =
        std::min((panel.cols - 50) / extent.x(), (panel.rows - 2 * kCaption - 30) / extent.y());
    const auto pixel = [&](const StateEstimate& state) {
        constexpr int kShift = 4;  // sub-pixel bits
        const double x = panel.cols / 2.0 + scale * (state.T_W_B.p[across] - middle.x());
        const double y = panel.rows / 2.0 - scale * (state.T_W_B.p[up] - middle.y());
        return cv::Point(cvRound(x * (1 << kShift)), cvRound(y * (1 << kShift)));
    };
    std::vector<cv::Point> line;
    for (const StateEstimate& state : truth) line.push_back(pixel(state));
    cv::polylines(panel, line, false, cv::Scalar(60), 1, cv::LINE_AA, 4);
    cv::circle(panel, line.front(), 4 << 4, cv::Scalar(0), cv::FILLED, cv::LINE_AA, 4);
    const double bar = round_length(0.4 * panel.cols / scale);
    const cv::Point at(12, panel.rows - 8);
    cv::line(panel, at, at + cv::Point(cvRound(bar * scale), 0), cv::Scalar(0), 2);
    write(panel, in_metres(bar), at + cv::Point(cvRound(bar * scale) + 6, 3));
    write(panel, title, {12, 16});
}

}  // namespace

cv::Mat contact_strip(const Simulation& simulation) {
    cv::Mat strip(kHeight, kImageWidth + 2 * kPanelWidth, CV_8U, cv::Scalar(255));
    const int middle = static_cast<int>(simulation.image_times().size() / 2);
    place(simulation.image(middle), strip(cv::Rect(0, kCaption, kImageWidth, kHeight - kCaption)));
    char facts[128];
    const auto& times = simulation.image_times();
    std::snprintf(facts, sizeof facts, "%s: %zu images, %.0f s, %.1f m",
                  simulation.options().name.c_str(), times.size(),
                  to_seconds(times.back() - times.front()), simulation.trajectory().path_length());
    write(strip, facts, {4, 16}, 0.42);
    draw_path(simulation.truth(), 0, 1, "above",
              strip(cv::Rect(kImageWidth, kCaption, kPanelWidth, kHeight - kCaption)));
    draw_path(
        simulation.truth(), 0, 2, "side",
        strip(cv::Rect(kImageWidth + kPanelWidth, kCaption, kPanelWidth, kHeight - kCaption)));
    cv::line(strip, {0, 0}, {strip.cols, 0}, cv::Scalar(160), 1);
    return strip;
}

}  // namespace vio
