// Feature tracks drawn on the images of a rawlog.
#pragma once

#include <functional>
#include <limits>
#include <string>

#include "libvio/io/recording.h"

namespace vio::app {

/// What to draw, and to which file; times in seconds.
struct TrackPictureRequest {
    std::string rawlog, output;
    RecordingOptions recording;
    bool video = false;  ///< a video of all images, else a picture of some of them
    int images = 6;      ///< in a picture
    double begin_s = 0,
           end_s = std::numeric_limits<double>::infinity();  ///< from the first measurement
};

/// Draws the features that the rawlog holds for its images; where it holds none, tracks them with
/// the built-in options. Throws InputError (no images, bad rawlog, file not writable).
void write_track_pictures(const TrackPictureRequest& request,
                          const std::function<void(double)>& progress);

}  // namespace vio::app
