#include "libvio/tracking/image_pyramid.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <utility>

namespace vio {
namespace {

constexpr double kBlankDeviation = 2.5;  // standard deviation of grey values of a blank image
constexpr double kBrightnessForgetting = 0.05, kMostGain = 4, kLeastGainChange = 0.02;

}  // namespace

bool ImagePyramid::add(const cv::Mat& image) {
    cv::Scalar mean, deviation;
    cv::meanStdDev(image, mean, deviation);
    if (deviation[0] < kBlankDeviation) return false;
    // Exposure is a gain, which Lucas and Kanade's method takes for motion: undo it.
    usual_brightness_ +=
        (usual_brightness_ > 0 ? kBrightnessForgetting : 1.0) * (mean[0] - usual_brightness_);
    const double gain = std::clamp(usual_brightness_ / mean[0], 1 / kMostGain, kMostGain);
    cv::Mat even;  // never the caller's pixels
    if (std::abs(gain - 1) > kLeastGainChange)
        image.convertTo(even, CV_8U, gain);
    else
        even = image;
    std::swap(newest_, previous_);
    // With a copy of the image: the caller may reuse his.
    cv::buildOpticalFlowPyramid(even, newest_, {window_px_, window_px_}, levels_, true,
                                cv::BORDER_REFLECT_101, cv::BORDER_CONSTANT, false);
    return true;
}

// The pyramid ends early where a level would be smaller than the window.
cv::Mat ImagePyramid::half() const {
    if (newest_.size() > 2) return newest_[2];
    cv::Mat half;
    cv::pyrDown(newest_[0], half);
    return half;
}

}  // namespace vio
