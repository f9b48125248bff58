#include "libvio/slam/motion_estimator.h"

#include <mrpt/core/initializer.h>
#include <mrpt/img/CImage.h>

#include <deque>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <variant>
#include <vector>

#include "libvio/base/options.h"
#include "libvio/batch/batch.h"
#include "libvio/io/calibration_file.h"
#include "libvio/io/mrpt_conversions.h"
#include "libvio/io/sensors.h"
#include "libvio/recursive/iekf.h"
#include "libvio/tracking/front_end.h"

IMPLEMENTS_VIRTUAL_MRPT_OBJECT(MotionEstimator, mrpt::rtti::CObject, vio)
IMPLEMENTS_MRPT_OBJECT(RecursiveEstimator, MotionEstimator, vio)
IMPLEMENTS_MRPT_OBJECT(BatchEstimator, MotionEstimator, vio)

MRPT_INITIALIZER(register_vio_estimators) {
    mrpt::rtti::registerClass(CLASS_ID(vio::MotionEstimator));
    mrpt::rtti::registerClass(CLASS_ID(vio::RecursiveEstimator));
    mrpt::rtti::registerClass(CLASS_ID(vio::BatchEstimator));
}

namespace vio {
namespace {

constexpr TimeNs kLongestSilence = 10LL * 1000000000LL;

// MRPT finds images that are stored in files by its own search path.
cv::Mat load_external(const std::string& file) {
    const std::string path = std::filesystem::path(mrpt::img::CImage::getImagesPathBase()) / file;
    const cv::Mat image = cv::imread(path, cv::IMREAD_UNCHANGED);
    if (image.empty())
        throw InputError("image file " + path +
                         " is missing or damaged; see mrpt::img::CImage::setImagesPathBase()");
    return image;
}

struct Settings {
    TrackerOptions tracker;
    BatchOptions batch;
    IekfOptions iekf;
    RecordingOptions recording;
    bool use_imu = true;

    OptionSet options() {
        OptionSet set;
        tracker.describe(set);
        batch.describe(set);
        iekf.describe(set);
        return set;
    }
};

}  // namespace

struct MotionEstimator::Impl {
    Kind kind;
    Settings settings;
    Sensors sensors;
    std::deque<Message> waiting;  // for the sensors to be known
    TimeNs first_time = 0;
    bool any = false;

    // Once they are.
    std::optional<TrackingFrontEnd> front_end;
    std::optional<Iekf> filter;
    BatchProblem problem;
    BatchResult result;

    void begin();
    void take(const Message& message);
    void add(const std::vector<FeatureFrame>& frames);
    void wait_for_sensors(const Message& message);
    void solve();
};

void MotionEstimator::Impl::begin() {
    for (const std::string& given : settings.recording.calibration_files)
        load_calibration(given, sensors.rig);
    if (!sensors.rig.camera)
        throw InputError("camera '" + sensors.camera_label +
                         "' is not calibrated; give a calibration file");
    front_end.emplace(settings.tracker, sensors.rig, settings.use_imu);
    // Of the batch, at most the start.
    if (kind == Kind::kRecursive || settings.batch.start == "iekf")
        filter.emplace(sensors.rig, settings.iekf, settings.batch, settings.use_imu);
    if (kind == Kind::kRecursive)
        front_end->set_predictor([this](TimeNs t) { return filter->predict(t); });
    problem.rig = sensors.rig;
    for (const Message& message : waiting) take(message);
    waiting.clear();
}

void MotionEstimator::Impl::take(const Message& message) {
    if (const auto* reading = std::get_if<ImuReading>(&message); reading && settings.use_imu) {
        if (filter) filter->add(*reading);
        if (kind == Kind::kBatch) problem.imu.push_back(*reading);
    }
    // Tracks that come as such stand for their images.
    if (sensors.features && std::holds_alternative<ImageMessage>(message)) return;
    add(front_end->add(message));
    if (kind == Kind::kRecursive) front_end->end_tracks(filter->take_rejected());
}

void MotionEstimator::Impl::add(const std::vector<FeatureFrame>& frames) {
    for (const FeatureFrame& frame : frames) {
        if (filter) filter->add(frame);
        if (kind == Kind::kBatch) problem.frames.push_back(frame);
    }
}

void MotionEstimator::Impl::wait_for_sensors(const Message& message) {
    const TimeNs t = std::visit([](const auto& m) { return m.t; }, message);
    if (!any) first_time = t;
    any = true;
    waiting.push_back(message);
    if (sensors.camera && (sensors.imu || !settings.use_imu)) return begin();
    if (t - first_time > kLongestSilence)
        throw InputError(std::string("no observation of the ") +
                         (sensors.camera ? "IMU" : "camera") +
                         " in the first 10 s; check the labels, or leave the IMU out");
}

// Images outside the readings cannot be estimated with them.
void MotionEstimator::Impl::solve() {
    const std::vector<ImuReading>& readings = problem.imu.readings();
    if (settings.use_imu && !readings.empty()) {
        const TimeNs offset = from_seconds(problem.rig.time_offset);
        std::erase_if(problem.frames, [&](const FeatureFrame& frame) {
            return frame.t + offset < readings.front().t || frame.t + offset > readings.back().t;
        });
    }
    std::optional<Estimate> start;
    if (filter) start = filter->take();
    result = estimate_batch(problem, settings.batch, start);
    if (!result.report.converged)
        throw InputError("the batch estimate has not converged: " + result.report.reason);
}

MotionEstimator::MotionEstimator(Kind kind) : impl_(std::make_unique<Impl>()) {
    impl_->kind = kind;
}

MotionEstimator::MotionEstimator(const MotionEstimator& other)
    : mrpt::rtti::CObject(), impl_(std::make_unique<Impl>()) {
    impl_->kind = other.impl_->kind;
    impl_->settings = other.impl_->settings;
}

MotionEstimator::~MotionEstimator() = default;

void MotionEstimator::load_options(const std::string& ini_file) {
    impl_->settings.options().load(ini_file);
}

void MotionEstimator::set_option(const std::string& assignment) {
    impl_->settings.options().set(assignment);
}

void MotionEstimator::set_calibration(const std::string& file) {
    Rig checked;
    load_calibration(file, checked);
    impl_->settings.recording.calibration_files = {file};
}

void MotionEstimator::set_labels(const std::string& camera, const std::string& imu) {
    impl_->settings.recording.camera_label = camera;
    impl_->settings.recording.imu_label = imu;
}

void MotionEstimator::ignore_imu() {
    impl_->settings.use_imu = false;
}

void MotionEstimator::process(const mrpt::obs::CObservation& observation) {
    Impl& e = *impl_;
    e.sensors.see(observation, e.settings.recording);
    const auto message = to_message(observation, e.sensors, load_external);
    if (!message) return;
    if (e.front_end)
        e.take(*message);
    else
        e.wait_for_sensors(*message);
}

void MotionEstimator::finish() {
    Impl& e = *impl_;
    if (!e.front_end)
        throw InputError(std::string("no observation of the ") +
                         (e.sensors.camera ? "IMU" : "camera") + " has come");
    e.add(e.front_end->finish());
    if (e.filter) e.filter->finish();
    if (e.kind == Kind::kBatch) e.solve();
}

std::optional<MotionEstimator::StampedPose> MotionEstimator::newest_pose() const {
    const Impl& e = *impl_;
    const StateEstimate* state = nullptr;
    if (e.kind == Kind::kRecursive)
        state = e.filter ? e.filter->newest() : nullptr;
    else if (!e.result.estimate.states.empty())
        state = &e.result.estimate.states.back();
    if (!state) return std::nullopt;
    const Matrix6d covariance = state->covariance.topLeftCorner<6, 6>();
    return StampedPose{to_mrpt(state->t), to_mrpt(state->T_W_B, covariance)};
}

const Estimate& MotionEstimator::estimate() const {
    const bool recursive = impl_->kind == Kind::kRecursive && impl_->filter;
    return recursive ? impl_->filter->estimate() : impl_->result.estimate;
}

const Rig& MotionEstimator::rig() const {
    const auto& refined = impl_->result.rig;
    return refined ? refined->rig : impl_->sensors.rig;
}

}  // namespace vio
