// Pictures compared as an eye would, not bit by bit, since OpenGL drivers round differently.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "gui_offscreen/snapshot.h"

namespace vio::test {

/// Share of the pixels whose colours differ visibly (by more than 6 of CIELAB, where 2.3 is just
/// noticeable side by side), once what is finer than the eye resolves at a normal size is blurred.
inline double visible_difference(const cv::Mat& a, const cv::Mat& b) {
    if (a.size() != b.size()) return 1;
    const auto seen = [](const cv::Mat& image) {
        cv::Mat lab;
        image.convertTo(lab, CV_32F, 1.0 / 255);
        cv::GaussianBlur(lab, lab, {}, 1.5);
        cv::cvtColor(lab, lab, cv::COLOR_BGR2Lab);
        return lab;
    };
    const cv::Mat p = seen(a), q = seen(b);
    int different = 0;
    for (int y = 0; y < p.rows; ++y)
        for (int x = 0; x < p.cols; ++x)
            different += cv::norm(p.at<cv::Vec3f>(y, x) - q.at<cv::Vec3f>(y, x)) > 6;
    return double(different) / double(p.total());
}

constexpr double kAlike = 0.002;

/// The picture looks as tests/golden/pictures/NAME.png. VIO_UPDATE_PICTURES=1 stores it anew (look
/// at it before a commit).
inline void expect_as_stored(const cv::Mat& picture, const std::string& name) {
    const std::string stored = VIO_SOURCE_DIR "/tests/golden/pictures/" + name + ".png";
    if (std::getenv("VIO_UPDATE_PICTURES")) save_image(picture, stored);
    const cv::Mat expected = cv::imread(stored);
    ASSERT_FALSE(expected.empty()) << stored;
    const double difference = visible_difference(picture, expected);
    const std::string seen =
        std::filesystem::temp_directory_path() / ("vio_picture_" + name + ".png");
    if (difference > kAlike) save_image(picture, seen);
    EXPECT_LE(difference, kAlike) << name << ": compare " << seen << " with " << stored;
}

}  // namespace vio::test
