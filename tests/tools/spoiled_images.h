// What cameras and their surroundings do to images.
#pragma once

#include <cmath>
#include <functional>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tests/tools/track_judgement.h"

namespace track_judgement {

// The image with this index as it arrives. Nothing: it is missing.
using Spoiler = std::function<std::optional<cv::Mat>(const cv::Mat&, int)>;

inline std::vector<std::pair<std::string, Spoiler>> spoilers() {
    const auto scaled = [](const cv::Mat& image, double gain, double offset) {
        cv::Mat result;
        image.convertTo(result, CV_8U, gain, offset);
        return result;
    };
    const auto dark = [](const cv::Mat& image, int i) {
        cv::Mat result(image.size(), CV_8U);
        cv::RNG(static_cast<uint64>(i) + 1).fill(result, cv::RNG::NORMAL, 3, 1.5);
        return result;
    };
    return {
        {"exposure to and fro by 3",
         [=](const cv::Mat& image, int i) {
             return scaled(image, std::pow(3, 0.5 * std::sin(0.5 * i) - 0.5), 5);
         }},
        {"3 of 15 blurred by 3 px",
         [](const cv::Mat& image, int i) {
             cv::Mat result = image.clone();  // others use the same pixels
             if (i % 15 > 11) cv::GaussianBlur(image, result, {}, 3);
             return result;
         }},
        // As even and odd lines in turn, each drawn twice.
        {"fields of interlaced images",
         [](const cv::Mat& image, int i) {
             cv::Mat result(image.size(), CV_8U);
             for (int y = 0; y < image.rows; ++y)
                 image.row(std::min((y & ~1) + i % 2, image.rows - 1)).copyTo(result.row(y));
             return result;
         }},
        {"3 of 15 missing",
         [](const cv::Mat& image, int i) {
             return i % 15 > 11 ? std::nullopt : std::optional<cv::Mat>(image);
         }},
        {"2 of 30 dark",
         [=](const cv::Mat& image, int i) { return i % 30 > 27 ? dark(image, i) : image; }},
        {"20 with the lens cap on",
         [=](const cv::Mat& image, int i) { return i >= 60 && i < 80 ? dark(image, i) : image; }},
    };
}

inline Input spoiled(const Input& input, const Spoiler& spoiler) {
    Input result = input;
    result.messages.clear();
    int i = 0;
    for (const Message& message : input.messages) {
        const auto* image = std::get_if<vio::ImageMessage>(&message);
        if (!image) {
            result.messages.push_back(message);
        } else if (const auto left = spoiler(image->image, i++)) {
            vio::ImageMessage changed = *image;
            changed.image = *left;
            result.messages.push_back(std::move(changed));
        }
    }
    return result;
}

}  // namespace track_judgement
