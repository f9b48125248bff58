#include "libvio/io/rawlog_writer.h"

#include <mrpt/obs/CObservationImage.h>
#include <mrpt/obs/CObservationOdometry.h>

#include <cmath>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "libvio/base/errors.h"
#include "libvio/io/calibration_file.h"
#include "libvio/io/gz_stream.h"
#include "libvio/io/mrpt_conversions.h"
#include "libvio/io/rawlog_objects.h"
#include "libvio/io/text.h"

namespace vio {
namespace {

namespace fs = std::filesystem;

// Departure from the plane that rounding explains [m, rad].
constexpr double kPlanar = 1e-9;

std::string without_extension(const std::string& file) {
    return fs::path(file).replace_extension().string();
}

}  // namespace

std::string calibration_sidecar(const std::string& rawlog_file) {
    return without_extension(rawlog_file) + ".calibration.ini";
}

struct RawlogWriter::Impl {
    Impl(const std::string& file_name, const Rig& rig_given, const RawlogWriterOptions& opts)
        : file(file_name),
          rig(rig_given),
          options(opts),
          params(to_mrpt(rig_given.camera)),
          T_B_C(to_mrpt(rig_given.T_B_C)),
          T_B_I(to_mrpt(rig_given.T_B_I)),
          out(file_name + ".partial") {
        register_mrpt_classes();
        if (options.external_images) make_images_dir();
    }

    ~Impl() {
        std::error_code ignored;
        if (!finished) fs::remove(file + ".partial", ignored);
    }

    void put(const ImuReading& reading);
    void put(const ImageMessage& message);
    void put(const FeatureFrame& frame);
    void put(const OdometryMessage& message);
    void put(const GpsMessage& fix);

    void put_object(const mrpt::serialization::CSerializable& object) { write_object(object, out); }
    void make_images_dir();
    InputError error(TimeNs t, const std::string& problem) const {
        return InputError(file + " (measurement at " + format_seconds(t) + " s): " + problem);
    }

    std::string file;
    Rig rig;
    RawlogWriterOptions options;
    mrpt::img::TCamera params;
    mrpt::poses::CPose3D T_B_C, T_B_I;
    fs::path images_dir;
    GzOutput out;
    bool finished = false;
};

void RawlogWriter::Impl::make_images_dir() {
    images_dir = without_extension(file) + "_Images";  // where MRPT looks for them
    std::error_code error_code;
    fs::create_directories(images_dir, error_code);
    if (error_code)
        throw InputError(images_dir.string() + ": cannot be made (" + error_code.message() + ")");
}

void RawlogWriter::Impl::put(const ImuReading& reading) {
    auto observation = to_mrpt(reading);
    observation.sensorLabel = options.imu_label;
    observation.sensorPose = T_B_I;
    put_object(observation);
}

void RawlogWriter::Impl::put(const ImageMessage& message) {
    if (message.image.type() != CV_8UC1 || message.image.empty())
        throw error(message.t, "the image is not 8-bit grey");
    mrpt::obs::CObservationImage observation;
    observation.timestamp = to_mrpt(message.t);
    observation.sensorLabel = options.camera_label;
    observation.cameraPose = T_B_C;
    observation.cameraParams = params;
    if (options.external_images) {
        const std::string name = options.camera_label + "_" + std::to_string(message.t) + ".png";
        const std::string path = (images_dir / name).string();
        if (!cv::imwrite(path, message.image))
            throw InputError(path + ": cannot be written; is the disk full?");
        observation.image.setExternalStorage(name);
    } else {
        observation.image = mrpt::img::CImage(message.image, mrpt::img::DEEP_COPY);
    }
    put_object(observation);
}

void RawlogWriter::Impl::put(const FeatureFrame& frame) {
    auto observation = to_mrpt(frame);
    observation.sensorLabel = options.camera_label;
    observation.cameraPose = T_B_C;
    observation.cameraParams = params;
    put_object(observation);
}

void RawlogWriter::Impl::put(const OdometryMessage& message) {
    const Eigen::Matrix3d& R = message.T_O_B.R;
    if (std::abs(message.T_O_B.p.z()) > kPlanar || std::abs(R(2, 2) - 1) > kPlanar)
        throw error(message.t, "odometry off the plane; MRPT's holds only x, y and yaw");
    mrpt::obs::CObservationOdometry observation;
    observation.timestamp = to_mrpt(message.t);
    observation.sensorLabel = "odometry";
    observation.odometry = mrpt::poses::CPose2D(message.T_O_B.p.x(), message.T_O_B.p.y(),
                                                std::atan2(R(1, 0), R(0, 0)));
    put_object(observation);
}

void RawlogWriter::Impl::put(const GpsMessage& fix) {
    auto observation = to_mrpt(fix);
    observation.sensorLabel = "gps";
    put_object(observation);
}

RawlogWriter::RawlogWriter(const std::string& file, const Rig& rig,
                           const RawlogWriterOptions& options)
    : impl_(std::make_unique<Impl>(file, rig, options)) {}

RawlogWriter::~RawlogWriter() = default;

void RawlogWriter::write(const Message& message) {
    std::visit([&](const auto& m) { impl_->put(m); }, message);
}

void RawlogWriter::finish() {
    impl_->out.close();
    std::error_code error;
    fs::rename(impl_->file + ".partial", impl_->file, error);
    if (error) throw InputError(impl_->file + ": cannot be written (" + error.message() + ")");
    impl_->finished = true;
    const CameraPtr& camera = impl_->rig.camera;
    write_text(calibration_sidecar(impl_->file),
               sidecar_text(impl_->rig, camera && !fits_mrpt(*camera)));
}

}  // namespace vio
