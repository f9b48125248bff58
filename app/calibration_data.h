// What calibrations of cameras start from: corners of a board in images.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "app/part.h"
#include "libvio/calibration/board.h"
#include "libvio/io/recording.h"

namespace vio::app {

/// What was seen of a board, and by which rig.
struct BoardViews {
    Rig rig;                           ///< as far as known; no camera from a folder of images
    int width = 0, height = 0;         ///< of the images [px]; 0: not known
    std::vector<FeatureFrame> frames;  ///< that show corners of the board, in order of time
    int images = 0;                    ///< that were looked at
    ImuSequence imu;                   ///< empty without one
};

/// Where the images or corners of a board come from.
struct BoardSource {
    std::string path;  ///< rawlog, folder of images, or image
    /// Of a folder's images or an image, as far as known: for BoardDetector.
    CameraPtr camera;
    RecordingOptions recording;
    PartRequest part;  ///< of a rawlog
};

/// From a rawlog's features, whose ids are the corners', or else from images: a rawlog's, those of
/// a folder (in order of their names, a second apart), or one. Shows progress on a terminal. Throws
/// InputError where there are none.
BoardViews read_board_views(const BoardSource& source, const Board& board);

/// --board, which read_board() takes, and --output.
void add_board_options(CLI::App& command, std::string& board, std::string& output);

}  // namespace vio::app
