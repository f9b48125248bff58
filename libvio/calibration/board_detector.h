// Corners of calibration targets in images.
#pragma once

#include <memory>
#include <opencv2/core.hpp>

#include "libvio/calibration/board.h"
#include "libvio/calibration/perspective_views.h"

namespace vio {

/// Finds a board's corners to a fraction of a pixel: AprilGrids (tag36h11, black border of one or
/// two bits; Kalibr's has two) by AprilTag, tag by tag, so that a part of the board suffices;
/// checkerboards by OpenCV, whole or not at all. A checkerboard whose corners are odd and even in
/// number is numbered the same from all sides, of others two numberings look alike.
class BoardDetector {
 public:
    /// Whether the library was built with AprilTag.
    static bool knows_april_grids();

    /// camera: of images that bend the board much or show it mirrored, as far as it is known. The
    /// board is then looked for in perspective views all around, and its corners refined in the
    /// image. Throws InputError for a board without a pattern, or an AprilGrid where the library
    /// was built without AprilTag.
    explicit BoardDetector(const Board& board, CameraPtr camera = nullptr);
    ~BoardDetector();

    /// The corners found, by their ids; none where the board is not seen. image: 8-bit grey.
    std::vector<FeatureObservation> detect(const cv::Mat& image) const;

 private:
    struct Tags;
    struct Look;
    void find(const Look& look, std::vector<FeatureObservation>& corners) const;
    void find_tags(const Look& look, std::vector<FeatureObservation>& corners) const;
    void find_checkerboard(const Look& look, std::vector<FeatureObservation>& corners) const;

    Board board_;
    std::unique_ptr<Tags> tags_;
    std::unique_ptr<PerspectiveViews> views_;  ///< nothing: corners are found in the image itself
};

}  // namespace vio
