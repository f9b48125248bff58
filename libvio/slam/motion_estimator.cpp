#include "libvio/slam/motion_estimator.h"

#include <mrpt/img/CImage.h>

#include <algorithm>
#include <deque>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <utility>

#include "libvio/base/errors.h"
#include "libvio/base/files.h"
#include "libvio/io/calibration_file.h"
#include "libvio/io/mrpt_conversions.h"
#include "libvio/io/sensors.h"
#include "libvio/io/text.h"
#include "libvio/slam/course.h"

IMPLEMENTS_VIRTUAL_MRPT_OBJECT(MotionEstimator, mrpt::rtti::CObject, vio)
IMPLEMENTS_MRPT_OBJECT(RecursiveEstimator, MotionEstimator, vio)
IMPLEMENTS_MRPT_OBJECT(BatchEstimator, MotionEstimator, vio)

namespace vio {
namespace {

// After the classes' names above have been initialised, which MRPT_INITIALIZER does not wait for.
[[maybe_unused]] const bool kRegistered = [] {
    mrpt::rtti::registerClass(CLASS_ID(MotionEstimator));
    mrpt::rtti::registerClass(CLASS_ID(RecursiveEstimator));
    mrpt::rtti::registerClass(CLASS_ID(BatchEstimator));
    return true;
}();

constexpr TimeNs kLongestSilence = 10LL * 1000000000LL;

// MRPT finds images that are stored in files by its own search path.
cv::Mat load_external(const std::string& file) {
    const std::string path = std::filesystem::path(mrpt::img::CImage::getImagesPathBase()) / file;
    const cv::Mat image = cv::imread(path, cv::IMREAD_UNCHANGED);
    if (image.empty())
        throw UnusableMeasurement(
            "image file " + path +
            " is missing or damaged; see mrpt::img::CImage::setImagesPathBase()");
    return image;
}

struct Settings {
    EstimationRequest request;
    RecordingOptions recording;
    bool keep_path = false;

    OptionSet options() {
        OptionSet set;
        request.options.describe(set);
        return set;
    }
};

}  // namespace

struct MotionEstimator::Impl {
    Settings settings;
    Sensors sensors;
    std::deque<Message> waiting;   // for the sensors to be known
    std::optional<Course> course;  // once they are
    Estimate shown;
    bool begun = false;       // an observation has come
    int unusable = 0;         // observations
    std::int64_t logged = 0;  // of the estimator's status

    // What may still be changed; throws InputError afterwards.
    Settings& before_the_first() {
        if (begun)
            throw InputError(
                "observations have come already; set options and calibration before the first one");
        return settings;
    }
    std::string silent_sensor() const { return sensors.camera ? "IMU" : "camera"; }
    void wait_for_sensors(const Message& message);
    void begin();
    void take(const Message& message);
    const Estimate& newest();
};

void MotionEstimator::Impl::wait_for_sensors(const Message& message) {
    waiting.push_back(message);
    if (sensors.camera && (sensors.imu || !settings.request.use_imu)) return begin();
    if (time_of(message) - time_of(waiting.front()) > kLongestSilence) {
        waiting.clear();
        throw InputError("no observation of the " + silent_sensor() +
                         " in the first 10 s; check the labels, or leave the IMU out");
    }
}

void MotionEstimator::Impl::begin() {
    const std::deque<Message> early = std::exchange(waiting, {});
    load_calibrations(settings.recording.calibration_files, sensors.rig);
    if (!sensors.rig.camera)
        throw InputError("camera '" + sensors.camera_label +
                         "' is not calibrated; give a calibration file");
    course.emplace(settings.request, sensors.rig);
    sensors.image_fits = false;  // that is by the files now
    for (const Message& message : early) {
        try {
            if (const auto* image = std::get_if<ImageMessage>(&message))
                check_size(image->image, image->t, sensors);
            take(message);
        } catch (const UnusableMeasurement&) {
            ++unusable;
        }
    }
}

void MotionEstimator::Impl::take(const Message& message) {
    // Tracks that come as such stand for their images.
    if (sensors.features && std::holds_alternative<ImageMessage>(message)) return;
    course->add(message);
    while (course->step())
        if (!settings.keep_path) course->estimator().take();
}

// The newest state alone, as if the path had been kept no longer than to it.
const Estimate& MotionEstimator::Impl::newest() {
    const Estimate& all = course->estimator().estimate();
    shown = {};
    if (const StateEstimate* state = course->estimator().newest()) shown.states = {*state};
    shown.landmarks = all.landmarks;
    shown.g_W = all.g_W;
    shown.gravity_covariance = all.gravity_covariance;
    shown.has_scale = all.has_scale;
    return shown;
}

MotionEstimator::MotionEstimator(Kind kind)
    : mrpt::system::COutputLogger("MotionEstimator"), impl_(std::make_unique<Impl>()) {
    logging_enable_console_output = false;
    impl_->settings.request.estimator = kind == Kind::kBatch ? "batch" : "iekf";
}

MotionEstimator::MotionEstimator(const MotionEstimator& other)
    : mrpt::rtti::CObject(), mrpt::system::COutputLogger(other), impl_(std::make_unique<Impl>()) {
    impl_->settings = other.impl_->settings;
}

MotionEstimator::~MotionEstimator() = default;

void MotionEstimator::load_options(const std::string& ini_file) {
    impl_->before_the_first().options().load(ini_file);
}

void MotionEstimator::set_option(const std::string& assignment) {
    impl_->before_the_first().options().set(assignment);
}

void MotionEstimator::set_calibration(const std::string& file) {
    if (!is_file(file))
        throw InputError(file + ": no such file; name an existing calibration file");
    impl_->before_the_first().recording.calibration_files.push_back(file);
}

void MotionEstimator::set_labels(const std::string& camera, const std::string& imu) {
    RecordingOptions& recording = impl_->before_the_first().recording;
    recording.camera_label = camera;
    recording.imu_label = imu;
}

void MotionEstimator::set_bit_depth(int bits) {
    if (bits < 8 || bits > 16)
        throw InputError("set_bit_depth: " + std::to_string(bits) + " is not from 8 to 16");
    impl_->before_the_first().recording.bit_depth = bits;
}

void MotionEstimator::ignore_imu() {
    impl_->before_the_first().request.use_imu = false;
}

void MotionEstimator::keep_path() {
    impl_->before_the_first().keep_path = true;
}

void MotionEstimator::process(const mrpt::obs::CObservation& observation) {
    Impl& e = *impl_;
    if (!e.begun) e.sensors.bit_depth = BitDepth(e.settings.recording.bit_depth);
    e.begun = true;
    try {
        e.sensors.see(observation, e.settings.recording);
        const auto message = to_message(observation, e.sensors, load_external);
        if (!message) return;
        if (e.course)
            e.take(*message);
        else
            e.wait_for_sensors(*message);
    } catch (const UnusableMeasurement& reason) {
        ++e.unusable;
        MRPT_LOG_WARN_STREAM("left out: " << reason.what());
    }
    log_news();
}

void MotionEstimator::finish() {
    Impl& e = *impl_;
    if (!e.course) throw InputError("no observation of the " + e.silent_sensor() + " has come");
    e.course->finish();
    log_news();
    const Estimator& estimator = e.course->estimator();
    if (!estimator.newest()) throw InputError(e.course->why_no_pose());
    if (!estimator.converged())
        throw InputError("the estimate has not converged: " + estimator.report());
}

void MotionEstimator::log_news() {
    if (!impl_->course) return;
    const auto& status = impl_->course->estimator().status();
    const auto known = [&](const StatusEntry& entry) { return entry.number < impl_->logged; };
    auto fresh = std::find_if(status.rbegin(), status.rend(), known).base();
    for (; fresh != status.end(); ++fresh) {
        MRPT_LOG_INFO_STREAM(format_seconds(fresh->t) << " s: " << fresh->text);
        impl_->logged = fresh->number + 1;
    }
}

std::optional<MotionEstimator::StampedPose> MotionEstimator::newest_pose() const {
    const auto& course = impl_->course;
    const StateEstimate* state = course ? course->estimator().newest() : nullptr;
    if (!state) return std::nullopt;
    const Matrix6d covariance = state->covariance.topLeftCorner<6, 6>();
    return StampedPose{to_mrpt(state->t), to_mrpt(state->T_W_B, covariance), state->lost};
}

const Estimate& MotionEstimator::estimate() const {
    Impl& e = *impl_;
    if (!e.course) return e.shown;
    const bool all = e.settings.keep_path || e.settings.request.estimator == "batch";
    return all ? e.course->estimator().estimate() : e.newest();
}

std::vector<StatusEntry> MotionEstimator::status() const {
    return impl_->course ? impl_->course->estimator().status() : std::vector<StatusEntry>();
}

MotionEstimator::LeftOut MotionEstimator::left_out() const {
    const CourseCounts counts = impl_->course ? impl_->course->counts() : CourseCounts();
    return {counts.repeated_messages, counts.late_messages, counts.dropped_images, impl_->unusable};
}

const Rig& MotionEstimator::rig() const {
    const auto& course = impl_->course;
    const bool batch = impl_->settings.request.estimator == "batch";
    const RefinedRig* refined = course && batch ? course->estimator().refined_rig() : nullptr;
    return refined ? refined->rig : impl_->sensors.rig;
}

}  // namespace vio
