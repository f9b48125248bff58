#include "libvio/io/recording.h"

#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CObservationImage.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/obs/CSensoryFrame.h>

#include <deque>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "libvio/base/errors.h"
#include "libvio/io/calibration_file.h"
#include "libvio/io/mrpt_conversions.h"
#include "libvio/io/rawlog_objects.h"
#include "libvio/io/rawlog_writer.h"
#include "libvio/io/text.h"

namespace vio {
namespace {

using namespace mrpt::obs;
namespace fs = std::filesystem;

// Camera time without an IMU reading (or the other way round) after which there is none.
constexpr TimeNs kScanLimit = 10LL * 1000000000LL;

// 8-bit grey of an image of any depth and number of channels.
cv::Mat to_grey(const cv::Mat& image) {
    cv::Mat grey = image;
    if (image.channels() == 3) cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
    if (image.channels() == 4) cv::cvtColor(image, grey, cv::COLOR_BGRA2GRAY);
    if (grey.depth() == CV_16U) grey.convertTo(grey, CV_8U, 1.0 / 256);
    return grey;
}

// 8-bit BGR of an image of any depth; empty if it is grey.
cv::Mat to_colour(const cv::Mat& image) {
    cv::Mat colour;
    if (image.channels() == 3) colour = image;
    if (image.channels() == 4) cv::cvtColor(image, colour, cv::COLOR_BGRA2BGR);
    if (colour.depth() == CV_16U) colour.convertTo(colour, CV_8U, 1.0 / 256);
    return colour;
}

// Where the rawlog's external images are: MRPT's own search, whose code misses the separator
// between folder and name.
fs::path images_directory(const std::string& file) {
    const fs::path path(file);
    for (const char* suffix : {"_Images", "_images", "_IMAGES"}) {
        const fs::path candidate = path.parent_path() / (path.stem().string() + suffix);
        if (fs::is_directory(candidate)) return candidate;
    }
    return path.parent_path() / "Images";
}

// All observations of one object of a rawlog, whichever of MRPT's two layouts it has.
void append_observations(const mrpt::serialization::CSerializable::Ptr& object,
                         std::deque<CObservation::Ptr>& out) {
    if (auto observation = std::dynamic_pointer_cast<CObservation>(object))
        out.push_back(observation);
    else if (const auto frame = std::dynamic_pointer_cast<CSensoryFrame>(object))
        out.insert(out.end(), frame->begin(), frame->end());
}

// What the beginning of a rawlog says about its sensors.
struct Sensors {
    std::string camera_label, imu_label;
    bool camera = false, imu = false, images = false, features = false;
    Rig rig;
    std::string camera_elsewhere;           ///< model of a camera that is described in a file
    std::string other_cameras, other_imus;  ///< labels seen, for an error message
    TimeNs first_camera = 0, last_camera = 0;

    void see(const CObservation& observation, const RecordingOptions& options);

 private:
    void see_camera(const CObservation& observation, const RecordingOptions& options,
                    const mrpt::img::TCamera& params);
    void see_imu(const CObservationIMU& observation, const RecordingOptions& options);
};

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

void Sensors::see_camera(const CObservation& observation, const RecordingOptions& options,
                         const mrpt::img::TCamera& params) {
    const std::string& label = observation.sensorLabel;
    if (!camera && (options.camera_label.empty() || options.camera_label == label)) {
        camera = true;
        camera_label = label;
        first_camera = from_mrpt(observation.timestamp);
    }
    if (!camera || label != camera_label) {
        other_cameras += " '" + label + "'";
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
        other_imus += " '" + observation.sensorLabel + "'";
        return;
    }
    imu = true;
    imu_label = observation.sensorLabel;
    rig.T_B_I = from_mrpt(observation.sensorPose);
}

bool enough(const Sensors& sensors, const RecordingOptions& options) {
    const TimeNs camera_span = sensors.last_camera - sensors.first_camera;
    if (sensors.camera && sensors.imu) return camera_span > 0;
    return sensors.camera && camera_span > kScanLimit && options.imu_label.empty();
}

std::string labels_seen(const std::string& labels) {
    return labels.empty() ? "; the file has none" : "; labels in the file:" + labels;
}

// Reads the beginning of the file for its sensors and their calibration. Damage further on is left
// for Recording::next() to report in its turn.
Sensors scan(const std::string& file, const RecordingOptions& options) {
    RawlogObjects objects(file);
    Sensors sensors;
    std::deque<CObservation::Ptr> observations;
    for (bool first = true; !enough(sensors, options); first = false) {
        mrpt::serialization::CSerializable::Ptr object;
        try {
            object = objects.next();
        } catch (const InputError&) {
            if (first) throw;
            break;
        }
        if (!object) break;
        observations.clear();
        append_observations(object, observations);
        try {
            for (const auto& observation : observations) sensors.see(*observation, options);
        } catch (const InputError& reason) {
            throw objects.error(reason.what());
        }
    }
    if (!options.camera_label.empty() && !sensors.camera)
        throw InputError(file + ": no camera labelled '" + options.camera_label + "'" +
                         labels_seen(sensors.other_cameras));
    if (!options.imu_label.empty() && !sensors.imu)
        throw InputError(file + ": no IMU labelled '" + options.imu_label + "'" +
                         labels_seen(sensors.other_imus));
    return sensors;
}

}  // namespace

struct Recording::Impl {
    Impl(const std::string& file_name, const RecordingOptions& options)
        : file(file_name),
          images_dir(images_directory(file_name)),
          sensors(scan(file_name, options)),
          objects(file_name) {
        const std::string sidecar = calibration_sidecar(file);
        if (fs::exists(sidecar)) load_calibration(sidecar, sensors.rig);
        if (!options.calibration_file.empty())
            load_calibration(options.calibration_file, sensors.rig);
        if (!sensors.rig.camera && !sensors.camera_elsewhere.empty())
            throw InputError(file + ": its camera is of the model " + sensors.camera_elsewhere +
                             ", which a rawlog cannot hold, and " + sidecar +
                             " is missing or has no section [camera]; put it beside the rawlog or "
                             "name another with --calibration");
    }

    std::optional<Message> next();
    std::optional<Message> convert(const CObservation& observation);
    std::optional<Message> convert(const CActionCollection& actions);
    ImageMessage convert_image(const CObservationImage& observation) const;
    cv::Mat load(const mrpt::img::CImage& image) const;
    void check_stamp(mrpt::Clock::time_point stamp) const;
    void check_features(const FeatureFrame& frame) const;

    std::string file;
    fs::path images_dir;
    Sensors sensors;
    RawlogObjects objects;
    std::deque<CObservation::Ptr> pending;  ///< of the object read last
    Pose T_O_B;                             ///< sum of odometry increments
};

void Recording::Impl::check_features(const FeatureFrame& frame) const {
    std::set<FeatureId> seen;
    const auto fail = [&](const FeatureObservation& f, const char* problem) {
        throw objects.error("feature " + std::to_string(f.feature_id) + " at " +
                            format_seconds(frame.t) + " s " + problem);
    };
    for (const FeatureObservation& f : frame.features) {
        if (!f.uv_px.allFinite()) fail(f, "has no finite position");
        if (!(f.covariance_shape(0, 0) > 0 && f.covariance_shape.determinant() > 0))
            fail(f, "has a covariance that is not positive definite");
        if (!seen.insert(f.feature_id).second) fail(f, "occurs twice in its image");
    }
}

void Recording::Impl::check_stamp(mrpt::Clock::time_point stamp) const {
    if (stamp == INVALID_TIMESTAMP)
        throw objects.error("an observation without time stamp; give it one or remove it");
}

cv::Mat Recording::Impl::load(const mrpt::img::CImage& image) const {
    if (!image.isExternallyStored()) return image.asCvMatRef();
    const fs::path path = images_dir / image.getExternalStorageFile();
    const cv::Mat loaded =  // OpenCV itself would print a warning
        fs::exists(path) ? cv::imread(path.string(), cv::IMREAD_UNCHANGED) : cv::Mat();
    if (loaded.empty())
        throw objects.error("image file " + path.string() +
                            " is missing or damaged; keep it beside the rawlog");
    return loaded;
}

ImageMessage Recording::Impl::convert_image(const CObservationImage& observation) const {
    const cv::Mat image = load(observation.image);
    if (image.empty()) throw objects.error("an image without pixels");
    const CameraPtr& camera = sensors.rig.camera;
    if (camera && (image.cols != camera->width() || image.rows != camera->height()))
        throw objects.error("the image has " + std::to_string(image.cols) + "x" +
                            std::to_string(image.rows) + " px, its calibration " +
                            std::to_string(camera->width()) + "x" +
                            std::to_string(camera->height()) + "; give the matching calibration");
    // Copies: the rawlog's object goes.
    return {from_mrpt(observation.timestamp), to_grey(image).clone(), to_colour(image).clone()};
}

// Nothing for an observation of another sensor or kind.
std::optional<Message> Recording::Impl::convert(const CObservation& observation) {
    if (const auto* imu = dynamic_cast<const CObservationIMU*>(&observation)) {
        if (!sensors.imu || imu->sensorLabel != sensors.imu_label) return {};
        check_stamp(imu->timestamp);
        const auto reading = from_mrpt(*imu);
        if (!reading) return {};
        if (!reading->gyro.allFinite() || !reading->accel.allFinite())
            throw objects.error("the IMU reading at " + format_seconds(reading->t) +
                                " s is not finite");
        return *reading;
    }
    if (const auto* image = dynamic_cast<const CObservationImage*>(&observation)) {
        if (image->sensorLabel != sensors.camera_label) return {};
        check_stamp(image->timestamp);
        return convert_image(*image);
    }
    if (const auto* features = dynamic_cast<const CObservationFeatures*>(&observation)) {
        if (features->sensorLabel != sensors.camera_label) return {};
        check_stamp(features->timestamp);
        FeatureFrame frame = from_mrpt(*features);
        check_features(frame);
        return frame;
    }
    if (const auto* odometry = dynamic_cast<const CObservationOdometry*>(&observation)) {
        check_stamp(odometry->timestamp);
        return OdometryMessage{from_mrpt(odometry->timestamp),
                               from_mrpt(mrpt::poses::CPose3D(odometry->odometry))};
    }
    if (const auto* gps = dynamic_cast<const CObservationGPS*>(&observation)) {
        const auto fix = from_mrpt(*gps);
        if (!fix) return {};
        check_stamp(gps->timestamp);
        return *fix;
    }
    return {};
}

// Odometry of the action / sensory-frame layout comes as increments: their sum is the pose.
std::optional<Message> Recording::Impl::convert(const CActionCollection& actions) {
    for (const auto& action : actions) {
        const std::optional<Pose> increment = odometry_increment(*action);
        if (!increment) continue;
        T_O_B = T_O_B * *increment;
        if (action->timestamp == INVALID_TIMESTAMP) return {};
        return OdometryMessage{from_mrpt(action->timestamp), T_O_B};
    }
    return {};
}

std::optional<Message> Recording::Impl::next() {
    while (true) {
        while (!pending.empty()) {
            const CObservation::Ptr observation = pending.front();
            pending.pop_front();
            if (auto message = convert(*observation)) return message;
        }
        const auto object = objects.next();
        if (!object) return {};
        append_observations(object, pending);
        if (const auto actions = std::dynamic_pointer_cast<CActionCollection>(object))
            if (auto message = convert(*actions)) return message;
    }
}

Recording::Recording(const std::string& file, const RecordingOptions& options)
    : impl_(std::make_unique<Impl>(file, options)) {}

Recording::~Recording() = default;

const Rig& Recording::rig() const {
    return impl_->sensors.rig;
}
bool Recording::has_imu() const {
    return impl_->sensors.imu;
}
bool Recording::has_images() const {
    return impl_->sensors.images;
}
bool Recording::has_features() const {
    return impl_->sensors.features;
}
std::optional<Message> Recording::next() {
    return impl_->next();
}
double Recording::progress() const {
    return impl_->objects.progress();
}

}  // namespace vio
