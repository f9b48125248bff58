#include "libvio/tracking/detector.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <tuple>

namespace vio {
namespace {

constexpr int kBlock = 5;                  // window of the structure tensor, in half-size pixels
constexpr float kWeakestResponse = 2e-5F;  // below it, sensor noise makes corners too

struct Corner {
    float response;
    int x, y;  // in the half-size image
};

std::vector<Corner> local_maxima(const cv::Mat& response, const cv::Mat& allowed, double quality) {
    double strongest = 0;
    cv::minMaxLoc(response, nullptr, &strongest, nullptr, nullptr, allowed);
    const float weakest = std::max(kWeakestResponse, static_cast<float>(quality * strongest));
    std::vector<Corner> corners;
    for (int y = 1; y + 1 < response.rows; ++y) {
        const float* above = response.ptr<float>(y - 1);
        const float* row = response.ptr<float>(y);
        const float* below = response.ptr<float>(y + 1);
        const unsigned char* ok = allowed.ptr(y);
        for (int x = 1; x + 1 < response.cols; ++x) {
            const float r = row[x];
            if (r < weakest || !ok[x]) continue;
            if (r < row[x - 1] || r <= row[x + 1]) continue;
            if (r < above[x - 1] || r < above[x] || r < above[x + 1]) continue;
            if (r <= below[x - 1] || r <= below[x] || r <= below[x + 1]) continue;
            corners.push_back({r, x, y});
        }
    }
    std::sort(corners.begin(), corners.end(), [](const Corner& a, const Corner& b) {
        return std::tie(b.response, a.y, a.x) < std::tie(a.response, b.y, b.x);
    });
    return corners;
}

// Which cells of the grid hold a feature.
class Grid {
 public:
    Grid(cv::Size size, int cells)
        : cell_px_(std::sqrt(static_cast<double>(size.area()) / std::max(1, cells))),
          columns_(static_cast<int>(size.width / cell_px_) + 1),
          taken_(static_cast<std::size_t>(columns_) *
                 (static_cast<std::size_t>(size.height / cell_px_) + 1)) {}

    bool taken(const Eigen::Vector2d& uv) const { return taken_[index(uv)]; }
    void take(const Eigen::Vector2d& uv) { taken_[index(uv)] = true; }

 private:
    std::size_t index(const Eigen::Vector2d& uv) const {
        return static_cast<std::size_t>(uv.y() / cell_px_) * static_cast<std::size_t>(columns_) +
               static_cast<std::size_t>(uv.x() / cell_px_);
    }
    double cell_px_;
    int columns_;
    std::vector<char> taken_;
};

cv::Mat allowed_region(cv::Size size, const cv::Mat& mask, double border_px) {
    cv::Mat allowed(size, CV_8U, cv::Scalar(0));
    const int border = static_cast<int>(std::ceil(border_px / 2));
    const cv::Rect inner(border, border, size.width - 2 * border, size.height - 2 * border);
    if (inner.width <= 0 || inner.height <= 0) return allowed;
    allowed(inner).setTo(255);
    if (!mask.empty()) {
        cv::Mat small;
        cv::resize(mask, small, size, 0, 0, cv::INTER_NEAREST);  // pixel (2x, 2y)
        allowed.setTo(0, small == 0);
    }
    return allowed;
}

}  // namespace

std::vector<Eigen::Vector2d> detect_features(const cv::Mat& half,
                                             const std::vector<Eigen::Vector2d>& existing,
                                             const cv::Mat& mask, int wanted, int max_features,
                                             const DetectorOptions& options) {
    std::vector<Eigen::Vector2d> found;
    if (wanted <= 0) return found;
    cv::Mat allowed = allowed_region(half.size(), mask, options.border_px);
    Grid grid({2 * half.cols, 2 * half.rows}, max_features);
    const int radius = std::max(1, static_cast<int>(std::lround(options.min_distance_px / 2)));
    const auto take = [&](const Eigen::Vector2d& uv) {
        const Eigen::Vector2d place = 0.5 * uv;
        cv::circle(
            allowed,
            {static_cast<int>(std::lround(place.x())), static_cast<int>(std::lround(place.y()))},
            radius, cv::Scalar(0), cv::FILLED);
        grid.take(uv);
    };
    cv::Mat response;
    cv::cornerMinEigenVal(half, response, kBlock, 3);
    for (const Eigen::Vector2d& uv : existing) take(uv);
    const std::vector<Corner> corners = local_maxima(response, allowed, options.quality);

    for (const bool empty_cells_only : {true, false})
        for (const Corner& corner : corners) {
            if (static_cast<int>(found.size()) == wanted) break;
            const Eigen::Vector2d uv(2.0 * corner.x, 2.0 * corner.y);
            if (!allowed.at<unsigned char>(corner.y, corner.x)) continue;
            if (empty_cells_only && grid.taken(uv)) continue;
            found.push_back(uv);
            take(uv);
        }
    return found;
}

}  // namespace vio
