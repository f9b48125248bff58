#include "libvio/io/recording.h"

#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CSensoryFrame.h>

#include <deque>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <set>

#include "libvio/base/errors.h"
#include "libvio/base/files.h"
#include "libvio/io/calibration_file.h"
#include "libvio/io/mrpt_conversions.h"
#include "libvio/io/rawlog_objects.h"
#include "libvio/io/rawlog_writer.h"
#include "libvio/io/sensors.h"

namespace vio {
namespace {

using namespace mrpt::obs;
namespace fs = std::filesystem;

// Camera time without an IMU reading (or the other way round) after which there is none.
constexpr TimeNs kScanLimit = 10LL * 1000000000LL;

// Where the rawlog's external images are: MRPT's own search, whose code misses the separator
// between folder and name.
fs::path images_directory(const std::string& file) {
    const fs::path path(file);
    for (const char* suffix : {"_Images", "_images", "_IMAGES"}) {
        fs::path candidate = path.parent_path() / (path.stem().string() + suffix);
        if (is_folder(candidate)) return candidate;
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

bool enough(const Sensors& sensors, const RecordingOptions& options) {
    const TimeNs camera_span = sensors.last_camera - sensors.first_camera;
    if (sensors.camera && sensors.imu) return camera_span > 0;
    return sensors.camera && camera_span > kScanLimit && options.imu_label.empty();
}

// " 'cam0' 'cam1'"
std::string quoted(const std::set<std::string>& labels) {
    std::string names;
    for (const std::string& label : labels) names += " '" + label + "'";
    return names;
}

std::string labels_seen(const std::set<std::string>& labels) {
    return labels.empty() ? "; the file has none" : "; labels in the file:" + quoted(labels);
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
        std::vector<std::string> files = options.calibration_files;
        if (is_there(sidecar)) files.insert(files.begin(), sidecar);
        load_calibrations(files, sensors.rig);
        if (!sensors.rig.camera && !sensors.camera_elsewhere.empty())
            throw InputError(file + ": its camera is of the model " + sensors.camera_elsewhere +
                             ", which a rawlog cannot hold, and " + sidecar +
                             " is missing or has no section [camera]; put it beside the rawlog or "
                             "name another with --calibration");
        if (sensors.images) sensors.bit_depth = find_depth(options.bit_depth);
    }

    BitDepth find_depth(int stated) const;
    cv::Mat load(const std::string& name) const;
    std::optional<Message> next();
    std::optional<Message> convert(const CActionCollection& actions);

    std::string file;
    fs::path images_dir;
    Sensors sensors;
    RawlogObjects objects;
    std::deque<CObservation::Ptr> pending;  ///< of the object read last
    LeftOutList left_out;
    Pose T_O_B;  ///< sum of odometry increments
};

// Odometry of the action / sensory-frame layout comes as increments: their sum is the pose.
std::optional<Message> Recording::Impl::convert(const CActionCollection& actions) {
    for (const auto& action : actions) {
        const std::optional<Pose> increment = odometry_increment(*action);
        if (!increment) continue;
        T_O_B = T_O_B * *increment;
        if (action->timestamp == INVALID_TIMESTAMP) {
            left_out.add("odometry poses", objects.error("an action without time stamp").what());
            return {};
        }
        return OdometryMessage{from_mrpt(action->timestamp), T_O_B};
    }
    return {};
}

// An image that is stored in a file.
cv::Mat Recording::Impl::load(const std::string& name) const {
    if (!is_folder(images_dir))
        throw InputError("its images are files in " + images_dir.string() +
                         ", which is missing; keep that folder beside the rawlog");
    const fs::path path = images_dir / name;
    cv::Mat image =  // OpenCV itself would print a warning about a missing file
        is_there(path) ? cv::imread(path.string(), cv::IMREAD_UNCHANGED) : cv::Mat();
    if (image.empty())
        throw UnusableMeasurement("image file " + path.string() + " is missing or damaged");
    return image;
}

// Looks at the first images; what is wrong with them is for next() to tell.
BitDepth Recording::Impl::find_depth(int stated) const {
    RawlogObjects ahead(file);
    std::deque<CObservation::Ptr> observations;
    const auto next_image = [&]() -> cv::Mat {
        while (true) {
            if (observations.empty()) {
                const auto object = ahead.next();
                if (!object) return {};
                append_observations(object, observations);
                continue;
            }
            const auto image = std::dynamic_pointer_cast<CObservationImage>(observations.front());
            observations.pop_front();
            if (!image || image->sensorLabel != sensors.camera_label) continue;
            try {
                return pixels_of(*image, [this](auto& name) { return load(name); }).clone();
            } catch (const UnusableMeasurement&) {
            }
        }
    };
    return find_bit_depth(stated, [&]() -> cv::Mat {
        try {
            return next_image();
        } catch (const InputError&) {
            return {};
        }
    });
}

std::optional<Message> Recording::Impl::next() {
    const ImageLoader loader = [this](const std::string& name) { return load(name); };
    while (true) {
        while (!pending.empty()) {
            const CObservation::Ptr observation = pending.front();
            pending.pop_front();
            sensors.see_aid(*observation);
            try {
                if (auto message = to_message(*observation, sensors, loader)) return message;
            } catch (const UnusableMeasurement& reason) {
                left_out.add(measurements_of(*observation), objects.error(reason.what()).what());
            } catch (const InputError& reason) {
                throw objects.error(reason.what());
            }
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
const LeftOutList& Recording::left_out() const {
    return impl_->left_out;
}
std::vector<std::string> Recording::remarks() const {
    const Sensors& sensors = impl_->sensors;
    std::vector<std::string> lines;
    if (const std::string depth = sensors.bit_depth.remark(); !depth.empty())
        lines.push_back(depth);
    std::string kinds;
    if (!sensors.other_cameras.empty()) kinds = " camera" + quoted(sensors.other_cameras);
    if (!sensors.other_imus.empty())
        kinds += (kinds.empty() ? " IMU" : ", IMU") + quoted(sensors.other_imus);
    if (!kinds.empty())
        lines.push_back("also in the file:" + kinds +
                        "; not used (--camera-label, --imu-label choose)");
    return lines;
}
double Recording::progress() const {
    return impl_->objects.progress();
}

}  // namespace vio
