// Corners of calibration targets in images.
#pragma once

#include <memory>
#include <opencv2/core.hpp>

#include "libvio/calibration/board.h"

namespace vio {

/// Finds a board's corners to a fraction of a pixel: AprilGrids (tag36h11, black border of one or
/// two bits; Kalibr's has two) by AprilTag, tag by tag, so that a part of the board suffices;
/// checkerboards by OpenCV, whole or not at all. A checkerboard whose corners are odd and even in
/// number is numbered the same from all sides, of others two numberings look alike.
class BoardDetector {
 public:
    /// Whether the library was built with AprilTag.
    static bool knows_april_grids();

    /// Throws InputError for a board without a pattern, or an AprilGrid where the library was built
    /// without AprilTag.
    explicit BoardDetector(const Board& board);
    ~BoardDetector();

    /// The corners found, by their ids; none where the board is not seen. image: 8-bit grey.
    std::vector<FeatureObservation> detect(const cv::Mat& image) const;

 private:
    struct Tags;
    std::vector<FeatureObservation> detect_tags(const cv::Mat& image) const;
    std::vector<FeatureObservation> detect_checkerboard(const cv::Mat& image) const;

    Board board_;
    std::unique_ptr<Tags> tags_;
};

}  // namespace vio
