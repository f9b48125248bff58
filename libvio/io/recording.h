// Reading a rawlog as a stream of the library's own measurements.
#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "libvio/base/types.h"
#include "libvio/camera/rig.h"
#include "libvio/io/left_out.h"

namespace vio {

/// An image and its time on the camera's clock [ns].
struct ImageMessage {
    TimeNs t = 0;
    cv::Mat image;        ///< 8-bit grey
    cv::Mat colour = {};  ///< the same as 8-bit BGR; empty if the recording is grey
};

/// Odometry pose of the vehicle in its own frame.
struct OdometryMessage {
    TimeNs t = 0;
    Pose T_O_B;
};

/// GPS fix, WGS84.
struct GpsMessage {
    TimeNs t = 0;
    double latitude_deg = 0, longitude_deg = 0, altitude_m = 0;
    int fix_quality = 0;
};

using Message = std::variant<ImuReading, ImageMessage, FeatureFrame, OdometryMessage, GpsMessage>;

inline TimeNs time_of(const Message& message) {
    return std::visit([](const auto& m) { return m.t; }, message);
}

/// Which sensors of a rawlog are taken, with which calibration.
struct RecordingOptions {
    std::string camera_label;  ///< empty: the first camera in the file
    std::string imu_label;     ///< empty: the first IMU in the file
    /// Calibrations that override the sidecar's and the rawlog's, key by key, each those before it;
    /// format in share/formats.md.
    std::vector<std::string> calibration_files;
    int bit_depth = 0;  ///< of images of 16 bits: see BitDepth
};

/// Streams a rawlog in bounded memory. Sensors with other labels than the chosen ones, and other
/// kinds of observations, are passed over.
class Recording {
 public:
    /// Opens the file and reads on to the first camera and IMU observation for the calibration.
    /// Throws InputError for a missing, foreign or damaged file.
    explicit Recording(const std::string& file, const RecordingOptions& options = {});
    ~Recording();

    /// Calibration that the rawlog carries, overridden by the sidecar NAME.calibration.ini beside
    /// NAME.rawlog where there is one (noise densities have no field in a rawlog), and by
    /// RecordingOptions::calibration_files. camera is null if there are no images and no features,
    /// or no calibration.
    const Rig& rig() const;
    /// Whether the IMU has a reading within 10 s of the first image; one that was named: anywhere.
    bool has_imu() const;
    bool has_images() const;
    bool has_features() const;

    /// Next message in file order; nothing at the clean end. A measurement that cannot be used is
    /// added to left_out() and passed over. Throws InputError (file, position, what was kept) where
    /// the file is damaged, its folder of images is missing, or the first image has not its
    /// calibration's size.
    std::optional<Message> next();

    /// The unusable measurements of the chosen sensors so far, for a warning.
    const LeftOutList& left_out() const;

    /// What was chosen, one line each: how 16-bit images are taken; cameras and IMUs that are in
    /// what has been read and are not used.
    std::vector<std::string> remarks() const;

    /// Share of the file that has been read, 0 to 1 (for progress).
    double progress() const;

 private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace vio
