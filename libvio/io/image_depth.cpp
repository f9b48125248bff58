#include "libvio/io/image_depth.h"

#include <algorithm>
#include <opencv2/imgcodecs.hpp>

#include "libvio/base/files.h"
#include "libvio/io/left_out.h"

namespace vio {
namespace {

double largest(const cv::Mat& image) {
    double value = 0;
    cv::minMaxLoc(image.reshape(1), nullptr, &value);
    return value;
}

double values(int bits) {
    return static_cast<double>(1 << bits);
}

}  // namespace

void BitDepth::see(const cv::Mat& image) {
    if (stated_ || image.depth() != CV_16U) return;
    const double value = largest(image);
    bits_ = std::max(bits_, 8);
    while (value >= values(bits_)) bits_ += 2;
}

cv::Mat BitDepth::to_8_bit(const cv::Mat& image) {
    if (image.depth() == CV_8U) return image;
    if (image.depth() != CV_16U)
        throw UnusableMeasurement("the image has neither 8 nor 16 bits a channel");
    if (bits_ == 0) see(image);
    if (largest(image) >= values(bits_))
        throw UnusableMeasurement("the image has values of more than " + std::to_string(bits_) +
                                  " bits, which were " +
                                  (stated_ ? "stated" : "found in the first images") +
                                  "; state how many it has with --bit-depth");
    const double step = values(bits_ - 8);
    cv::Mat bytes;  // to the nearest of what is half a step less: down
    image.convertTo(bytes, CV_8U, 1 / step, -(step - 1) / 2 / step);
    return bytes;
}

std::string BitDepth::remark() const {
    if (stated_ || bits_ == 0) return "";
    return "images of 16 bits, " + std::to_string(bits_) +
           " of them significant by the largest value found; else state how many with --bit-depth";
}

BitDepth find_bit_depth(int stated, const std::function<cv::Mat()>& next) {
    BitDepth depth(stated);
    for (int i = 0; stated == 0 && i < BitDepth::kImages; ++i) {
        const cv::Mat image = next();
        if (image.empty() || (i == 0 && image.depth() == CV_8U)) break;
        depth.see(image);
    }
    return depth;
}

BitDepth find_bit_depth(int stated, const std::vector<std::filesystem::path>& files) {
    const std::size_t most = std::min<std::size_t>(files.size(), BitDepth::kImages);
    std::size_t k = 0;
    return find_bit_depth(stated, [&] {
        cv::Mat image;
        while (image.empty() && k < most)
            image = read_grey(files[k++ * (files.size() - 1) / std::max<std::size_t>(1, most - 1)]);
        return image;
    });
}

cv::Mat read_grey(const std::filesystem::path& file) {
    // OpenCV itself would print a warning about a missing file.
    if (!is_file(file)) return {};
    return cv::imread(file.string(), cv::IMREAD_GRAYSCALE | cv::IMREAD_ANYDEPTH);
}

}  // namespace vio
