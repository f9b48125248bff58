#include "libvio/io/sensors.h"

#include <mrpt/obs/CObservationGPS.h>
#include <mrpt/obs/CObservationOdometry.h>

#include <opencv2/imgproc.hpp>
#include <set>

#include "libvio/base/errors.h"
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
    if (imu || !from_mrpt(observation)) return;  // others: see to_message()
    if (!options.imu_label.empty() && options.imu_label != observation.sensorLabel) {
        other_imus.insert(observation.sensorLabel);
        return;
    }
    imu = true;
    imu_label = observation.sensorLabel;
    rig.T_B_I = from_mrpt(observation.sensorPose);
}

namespace {

// Grey of an image of any number of channels.
cv::Mat to_grey(const cv::Mat& image) {
    cv::Mat grey = image;
    if (image.channels() == 3) cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
    if (image.channels() == 4) cv::cvtColor(image, grey, cv::COLOR_BGRA2GRAY);
    return grey;
}

// BGR of an image; empty if it is grey.
cv::Mat to_colour(const cv::Mat& image) {
    cv::Mat colour;
    if (image.channels() == 3) colour = image;
    if (image.channels() == 4) cv::cvtColor(image, colour, cv::COLOR_BGRA2BGR);
    return colour;
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

ImageMessage convert_image(const CObservationImage& observation, Sensors& sensors,
                           const ImageLoader& load) {
    const cv::Mat image = pixels_of(observation, load);
    check_size(image, from_mrpt(observation.timestamp), sensors);
    const cv::Mat colour = to_colour(image);
    const cv::Mat bytes = sensors.bit_depth.to_8_bit(colour.empty() ? image : colour);
    // Copies: the observation goes.
    ImageMessage message{from_mrpt(observation.timestamp), to_grey(bytes).clone()};
    if (!colour.empty()) message.colour = bytes.clone();
    return message;
}

}  // namespace

void check_size(const cv::Mat& image, TimeNs t, Sensors& sensors) {
    const CameraPtr& camera = sensors.rig.camera;
    if (!camera) return;
    const auto size = [](int width, int height) {
        return std::to_string(width) + "x" + std::to_string(height);
    };
    if (image.cols == camera->width() && image.rows == camera->height()) {
        sensors.image_fits = true;
        return;
    }
    const std::string sizes = "the image at " + format_seconds(t) + " s has " +
                              size(image.cols, image.rows) + " px, its calibration " +
                              size(camera->width(), camera->height());
    if (sensors.image_fits) throw UnusableMeasurement(sizes);
    throw InputError(sizes + "; give the matching calibration");
}

cv::Mat pixels_of(const CObservationImage& observation, const ImageLoader& load) {
    const mrpt::img::CImage& stored = observation.image;
    cv::Mat image =
        stored.isExternallyStored() ? load(stored.getExternalStorageFile()) : stored.asCvMatRef();
    if (image.empty()) throw UnusableMeasurement("an image without pixels");
    return image;
}

std::optional<Message> to_message(const CObservation& observation, Sensors& sensors,
                                  const ImageLoader& load) {
    const auto of_camera = [&] {
        if (observation.sensorLabel == sensors.camera_label) return true;
        sensors.other_cameras.insert(observation.sensorLabel);
        return false;
    };
    if (const auto* imu = dynamic_cast<const CObservationIMU*>(&observation)) {
        if (!sensors.imu || imu->sensorLabel != sensors.imu_label) {
            if (from_mrpt(*imu)) sensors.other_imus.insert(imu->sensorLabel);
            return {};
        }
        check_stamp(imu->timestamp);
        const auto reading = from_mrpt(*imu);
        if (!reading) return {};
        if (!reading->gyro.allFinite() || !reading->accel.allFinite())
            throw UnusableMeasurement("the IMU reading at " + format_seconds(reading->t) +
                                      " s is not finite");
        return *reading;
    }
    if (const auto* image = dynamic_cast<const CObservationImage*>(&observation)) {
        if (!of_camera()) return {};
        check_stamp(image->timestamp);
        return convert_image(*image, sensors, load);
    }
    if (const auto* features = dynamic_cast<const CObservationFeatures*>(&observation)) {
        if (!of_camera()) return {};
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
