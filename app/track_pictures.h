// Feature tracks drawn on the images of a rawlog.
#pragma once

#include <functional>
#include <string>

#include "app/part.h"
#include "libvio/io/recording.h"

namespace vio::app {

/// What to draw, and to which file.
struct TrackPictureRequest {
    std::string rawlog, output;
    RecordingOptions recording;
    bool video = false;  ///< a video of all images, else a picture of some of them
    int images = 6;      ///< in a picture
    PartRequest part;
};

/// Draws the features that the rawlog holds for its images; where it holds none, tracks them with
/// the built-in options. Throws InputError (no images, bad rawlog, file not writable).
void write_track_pictures(const TrackPictureRequest& request,
                          const std::function<void(double)>& progress);

}  // namespace vio::app
