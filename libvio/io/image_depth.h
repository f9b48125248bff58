// Images of 16 bits a channel, of which cameras often fill only the lower 10, 12 or 14.
#pragma once

#include <filesystem>
#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace vio {

/// How many of 16 bits are significant: one number for all images of a recording, so that they keep
/// their brightness from one to the next. It is stated, or that of the largest value in the first
/// images.
class BitDepth {
 public:
    static constexpr int kImages = 20;  ///< that are looked at, where there are as many

    /// bits: 8 to 16; 0: to be found.
    explicit BitDepth(int bits = 0) : bits_(bits), stated_(bits > 0) {}

    /// Takes an image of 16 bits a channel into account where the number is to be found: the fewest
    /// of 8, 10, 12, 14 and 16 bits that hold its values, and those of the images before.
    void see(const cv::Mat& image);

    /// The image in 8 bits a channel: of 16 the highest of those that are significant, rounded
    /// down. If nothing is known yet, this image tells it. Images that have 8 already are not
    /// copied. Throws UnusableMeasurement (the reason only) for values beyond the significant bits,
    /// and for images that have neither 8 nor 16 bits.
    cv::Mat to_8_bit(const cv::Mat& image);

    int bits() const { return bits_; }  ///< 0: not known
    /// What has been found, in a line; empty: nothing.
    std::string remark() const;

 private:
    int bits_;
    bool stated_;
};

/// As stated, or found from what `next` gives, up to BitDepth::kImages or an empty image. A first
/// image of 8 bits ends the search: the others are taken to be alike.
BitDepth find_bit_depth(int stated, const std::function<cv::Mat()>& next);
/// The same from images evenly spread over these files; those that cannot be read are passed over.
BitDepth find_bit_depth(int stated, const std::vector<std::filesystem::path>& files);

/// An image file as grey of 8 or 16 bits; empty if it is missing or damaged.
cv::Mat read_grey(const std::filesystem::path& file);

}  // namespace vio
