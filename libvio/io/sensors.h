// What the observations of a rawlog, or of live sensors, say to the library.
#pragma once

#include <mrpt/img/TCamera.h>
#include <mrpt/obs/CObservation.h>
#include <mrpt/obs/CObservationIMU.h>
#include <mrpt/obs/CObservationImage.h>

#include <functional>
#include <opencv2/core.hpp>
#include <optional>
#include <set>
#include <string>

#include "libvio/camera/rig.h"
#include "libvio/io/image_depth.h"
#include "libvio/io/recording.h"

namespace vio {

/// The camera and the IMU that are used, as their observations describe them.
struct Sensors {
    std::string camera_label, imu_label;
    bool camera = false, imu = false, images = false, features = false;
    Rig rig;
    std::string camera_elsewhere;  ///< model of a camera that is described in a file
    std::set<std::string> other_cameras, other_imus;  ///< labels seen, of those that are not used
    bool image_fits = false;                          ///< one of the calibration's size has come
    BitDepth bit_depth;
    TimeNs first_camera = 0, last_camera = 0;
    std::optional<std::string> odometry_label, gps_label;  ///< of the first; nothing: none yet

    /// The first camera and the first IMU, or those with the labels of the options, are taken; what
    /// is known already stays. Throws InputError (the reason only) for a calibration that MRPT
    /// cannot mean.
    void see(const mrpt::obs::CObservation& observation, const RecordingOptions& options);
    /// The first odometry and the first GPS with a fix are taken.
    void see_aid(const mrpt::obs::CObservation& observation);

 private:
    void see_camera(const mrpt::obs::CObservation& observation, const RecordingOptions& options,
                    const mrpt::img::TCamera& params);
    void see_imu(const mrpt::obs::CObservationIMU& observation, const RecordingOptions& options);
};

/// Pixels of an image that is stored outside the observation. Throws UnusableMeasurement or
/// InputError (the reason only), as for one image or for all.
using ImageLoader = std::function<cv::Mat(const std::string& file)>;

/// Throws InputError (the reason only) for an image that has not the size of the camera's
/// calibration, if there is one; after one that has it, UnusableMeasurement.
void check_size(const cv::Mat& image, TimeNs t, Sensors& sensors);

/// The image as it is stored, of any depth and number of channels. Throws as `load`, and
/// UnusableMeasurement if it has no pixels.
cv::Mat pixels_of(const mrpt::obs::CObservationImage& observation, const ImageLoader& load);

/// The observation as a measurement; nothing for one of another sensor or kind, or of odometry or
/// GPS other than those that see_aid() has taken. Notes in the sensors what it passes over. Throws
/// UnusableMeasurement (the reason only) for what no sensor can have measured, for pixels that are
/// not there, and for an image of another size than those before; InputError where the first image
/// has not the size of its calibration.
std::optional<Message> to_message(const mrpt::obs::CObservation& observation, Sensors& sensors,
                                  const ImageLoader& load);

/// What the observation's measurements are, in the plural: "IMU readings", "images", ...
const char* measurements_of(const mrpt::obs::CObservation& observation);

}  // namespace vio
