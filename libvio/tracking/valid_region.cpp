#include "libvio/tracking/valid_region.h"

#include <opencv2/imgproc.hpp>

namespace vio {

cv::Mat valid_region(const Camera& camera, int border_px) {
    cv::Mat region(camera.height(), camera.width(), CV_8U, cv::Scalar(255));
    bool all = true;
    for (int v = 0; v < region.rows; ++v) {
        unsigned char* row = region.ptr(v);
        for (int u = 0; u < region.cols; ++u)
            if (!camera.ray({u, v})) {
                row[u] = 0;
                all = false;
            }
    }
    if (all) return {};
    const int side = 2 * border_px + 1;
    cv::Mat
        shrunk;  // what lies outside the image counts as seen: its edge is no edge of the region
    cv::erode(region, shrunk, cv::getStructuringElement(cv::MORPH_ELLIPSE, {side, side}));
    return shrunk;
}

}  // namespace vio
