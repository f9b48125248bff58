#include "libvio/io/sensors.h"

#include <mrpt/obs/CObservationGPS.h>
#include <mrpt/obs/CObservationImage.h>
#include <mrpt/obs/CObservationOdometry.h>

#include <opencv2/imgproc.hpp>
#include <set>

#include "libvio/base/errors.h"
#include "libvio/io/image_depth.h"
#include "libvio/io/mrpt_conversions.h"
#include "libvio/io/text.h"

namespace vio {

using namespace mrpt::obs;

void Sensors::see(const CObservation& observation, const RecordingOptions& options) {
    if (const auto* image = dynamic_cast<const CObservationImage*>(&observation)) {
        see_camera(observation, options, image->cameraParams);
        images = images || (camera && image->sensorLabel == camera_label);
    } else if (const auto* tracks = dynamic_cast<const CObservationFeatures*>(&observation)) {
        see_camera(observation, options, tracks->cameraParams);
        features = features || (camera && tracks->sensorLabel == camera_label);
    } else if (const auto* reading = dynamic_cast<const CObservationIMU*>(&observation)) {
        see_imu(*reading, options);
    }
}

void Sensors::see_aid(const CObservation& observation) {
    if (!odometry_label && dynamic_cast<const CObservationOdometry*>(&observation))
        odometry_label = observation.sensorLabel;
    const auto* gps = gps_label ? nullptr : dynamic_cast<const CObservationGPS*>(&observation);
    if (gps && from_mrpt(*gps)) gps_label = gps->sensorLabel;
}

void Sensors::see_camera(const CObservation& observation, const RecordingOptions& options,
                         const mrpt::img::TCamera& params) {
    const std::string& label = observation.sensorLabel;
    if (!camera && (options.camera_label.empty() || options.camera_label == label)) {
        camera = true;
        camera_label = label;
        first_camera = from_mrpt(observation.timestamp);
    }
    if (!camera || label != camera_label) {
        other_cameras.insert(label);
        return;
    }
    last_camera = from_mrpt(observation.timestamp);
    if (rig.camera || !camera_elsewhere.empty()) return;
    rig.camera = from_mrpt(params);
    camera_elsewhere = model_elsewhere(params);
    mrpt::poses::CPose3D T_B_C;  // not by TPose3D, which rounds through yaw, pitch and roll
    observation.getSensorPose(T_B_C);
    rig.T_B_C = from_mrpt(T_B_C);
}

void Sensors::see_imu(const CObservationIMU& observation, const RecordingOptions& options) {
    if (imu || !from_mrpt(observation)) return;
    if (!options.imu_label.empty() && options.imu_label != observation.sensorLabel) {
        other_imus.insert(observation.sensorLabel);
        return;
    }
    imu = true;
    imu_label = observation.sensorLabel;
    rig.T_B_I = from_mrpt(observation.sensorPose);
}

namespace {

// 8-bit grey of an image of any depth and number of channels.
cv::Mat to_grey(const cv::Mat& image) {
    cv::Mat grey = image;
    if (image.channels() == 3) cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
    if (image.channels() == 4) cv::cvtColor(image, grey, cv::COLOR_BGRA2GRAY);
    return to_8_bit(grey);
}

// 8-bit BGR of an image of any depth; empty if it is grey.
cv::Mat to_colour(const cv::Mat& image) {
    cv::Mat colour;
    if (image.channels() == 3) colour = image;
    if (image.channels() == 4) cv::cvtColor(image, colour, cv::COLOR_BGRA2BGR);
    return to_8_bit(colour);
}

void check_features(const FeatureFrame& frame) {
    std::set<FeatureId> seen;
    const auto fail = [&](const FeatureObservation& f, const char* problem) {
        throw UnusableMeasurement("feature " + std::to_string(f.feature_id) + " at " +
                                  format_seconds(frame.t) + " s " + problem);
    };
    for (const FeatureObservation& f : frame.features) {
        if (!f.uv_px.allFinite()) fail(f, "has no finite position");
        if (!(f.covariance_shape(0, 0) > 0 && f.covariance_shape.determinant() > 0))
            fail(f, "has a covariance that is not positive definite");
        if (!seen.insert(f.feature_id).second) fail(f, "occurs twice in its image");
    }
}

void check_stamp(mrpt::Clock::time_point stamp) {
    if (stamp == INVALID_TIMESTAMP)
        throw UnusableMeasurement("an observation without time stamp; give it one or remove it");
}

ImageMessage convert_image(const CObservationImage& observation, const CameraPtr& camera,
                           const ImageLoader& load) {
    const mrpt::img::CImage& stored = observation.image;
    const cv::Mat image =
        stored.isExternallyStored() ? load(stored.getExternalStorageFile()) : stored.asCvMatRef();
    if (image.empty()) throw UnusableMeasurement("an image without pixels");
    if (camera && (image.cols != camera->width() || image.rows != camera->height()))
        throw InputError("the image has " + std::to_string(image.cols) + "x" +
                         std::to_string(image.rows) + " px, its calibration " +
                         std::to_string(camera->width()) + "x" + std::to_string(camera->height()) +
                         "; give the matching calibration");
    // Copies: the observation goes.
    return {from_mrpt(observation.timestamp), to_grey(image).clone(), to_colour(image).clone()};
}

}  // namespace

std::optional<Message> to_message(const CObservation& observation, const Sensors& sensors,
                                  const ImageLoader& load) {
    if (const auto* imu = dynamic_cast<const CObservationIMU*>(&observation)) {
        if (!sensors.imu || imu->sensorLabel != sensors.imu_label) return {};
        check_stamp(imu->timestamp);
        const auto reading = from_mrpt(*imu);
        if (!reading) return {};
        if (!reading->gyro.allFinite() || !reading->accel.allFinite())
            throw UnusableMeasurement("the IMU reading at " + format_seconds(reading->t) +
                                      " s is not finite");
        return *reading;
    }
    if (const auto* image = dynamic_cast<const CObservationImage*>(&observation)) {
        if (image->sensorLabel != sensors.camera_label) return {};
        check_stamp(image->timestamp);
        return convert_image(*image, sensors.rig.camera, load);
    }
    if (const auto* features = dynamic_cast<const CObservationFeatures*>(&observation)) {
        if (features->sensorLabel != sensors.camera_label) return {};
        check_stamp(features->timestamp);
        FeatureFrame frame = from_mrpt(*features);
        check_features(frame);
        return frame;
    }
    if (const auto* odometry = dynamic_cast<const CObservationOdometry*>(&observation)) {
        if (odometry->sensorLabel != sensors.odometry_label) return {};
        check_stamp(odometry->timestamp);
        return OdometryMessage{from_mrpt(odometry->timestamp),
                               from_mrpt(mrpt::poses::CPose3D(odometry->odometry))};
    }
    if (const auto* gps = dynamic_cast<const CObservationGPS*>(&observation)) {
        if (gps->sensorLabel != sensors.gps_label) return {};
        const auto fix = from_mrpt(*gps);
        if (!fix) return {};
        check_stamp(gps->timestamp);
        return *fix;
    }
    return {};
}

const char* measurements_of(const CObservation& observation) {
    if (dynamic_cast<const CObservationIMU*>(&observation)) return "IMU readings";
    if (dynamic_cast<const CObservationImage*>(&observation)) return "images";
    if (dynamic_cast<const CObservationFeatures*>(&observation)) return "feature frames";
    return "odometry poses and GPS fixes";
}

}  // namespace vio
