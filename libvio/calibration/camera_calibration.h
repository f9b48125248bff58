// Intrinsics of a camera from images of a board.
#pragma once

#include "libvio/calibration/board.h"
#include "libvio/calibration/rig_calibration.h"

namespace vio {

/// Which model is fitted, to what.
struct CameraCalibrationOptions {
    std::string model = "perspective";  ///< or fisheye
    int distortion = 5;         ///< coefficients: 4, 5 or 8 of a perspective camera; fisheye 4
    int width = 0, height = 0;  ///< of the images [px]
    int most_images = 60;       ///< evenly taken from all that show the board; 0: all
    double sigma_px = 0;        ///< of a corner's place; 0: from the residuals
};

/// How the corners that were used are spread.
struct Coverage {
    static constexpr int kCols = 8, kRows = 6;
    int cells[kRows][kCols] = {};  ///< corners in each part of the image
    double share = 0;              ///< of these parts that hold a corner
    double widest_tilt = 0;        ///< of the board against the image plane [rad]
    double outermost = 0;          ///< corner's distance from the image's middle, as a share of the
                                   ///< distance of its own corners
    std::vector<std::string> warnings;  ///< what is poor about it, in words; empty: nothing
};

/// The camera found, its uncertainty, and how much of the image the corners covered.
struct CameraCalibration {
    RigCalibration rig;  ///< rig.camera; covariance and names of the intrinsics
    Coverage coverage;
    int images_with_board = 0;
};

/// Starts from the focal length, on a grid, at which the board's poses fit best without distortion;
/// then minimises over poses and intrinsics at once. Throws InputError where too few images show
/// enough of the board, or they do not determine the intrinsics.
CameraCalibration calibrate_camera(const std::vector<FeatureFrame>& frames, const Board& board,
                                   const CameraCalibrationOptions& options);

}  // namespace vio
