#include "app/pipeline.h"

#include <chrono>
#include <deque>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "app/estimator.h"
#include "app/progress.h"
#include "app/run_output.h"
#include "libvio/check/recording_check.h"
#include "libvio/io/results.h"
#include "libvio/io/trajectory_io.h"
#include "libvio/recursive/message_queue.h"
#include "libvio/tracking/front_end.h"

namespace vio::app {
namespace {

// Runs work and adds the time that it took to seconds.
template <typename Work>
auto timed(double& seconds, Work work) {
    struct Watch {
        double& seconds;
        std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
        ~Watch() {
            seconds +=
                std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        }
    } watch{seconds};
    return work();
}

void check_sensors(const Recording& recording, const RunRequest& request) {
    if (!recording.has_images() && !recording.has_features())
        throw InputError(request.rawlog +
                         ": no images and no features; name the camera with --camera-label or give "
                         "a rawlog that holds CObservationImage");
    if (!recording.rig().camera)
        throw InputError(request.rawlog +
                         ": the camera is not calibrated; give --calibration FILE");
    if (request.use_imu && !recording.has_imu())
        throw InputError(
            request.rawlog +
            ": no IMU readings; use --sensors image, or name the IMU with --imu-label");
}

// Whether a measurement lies in the part of the recording that was asked for. IMU readings around
// it are kept, so that its first and last image lie between readings.
class Part {
 public:
    explicit Part(const RunRequest& request) : request_(request) {}

    bool contains(const Message& message) {
        const TimeNs t = std::visit([](const auto& m) { return m.t; }, message);
        if (!origin_) origin_ = t;
        const double seconds = to_seconds(t - *origin_);
        beyond_ = seconds > request_.end_s + request_.options.iekf.message_window ? beyond_ + 1 : 0;
        const double margin = std::holds_alternative<ImuReading>(message) ? 0.1 : 0;
        return seconds >= request_.begin_s - margin && seconds <= request_.end_s + margin;
    }

    /// Whether none of the part is to come: one message beyond it may have a wrong stamp.
    bool is_over() const { return beyond_ > 100; }

 private:
    const RunRequest& request_;
    std::optional<TimeNs> origin_;
    int beyond_ = 0;  // messages in a row
};

// An image, or its features, on the IMU's clock.
struct TimedMessage {  // NOLINT(bugprone-exception-escape): std::variant's own promise
    TimeNs t_imu = 0;
    Message message;
};

// Hands measurements to the estimator. An image outside the IMU's readings cannot be estimated with
// them: it is held back until readings reach it, and dropped if they never do; but the filter goes
// on without readings after a while.
class Feeder {
 public:
    Feeder(Estimator& estimator, RunOutput& output, const RunRequest& request, const Rig& rig,
           RunReport& report)
        : estimator_(estimator),
          output_(output),
          use_imu_(request.use_imu),
          patient_(request.estimator != "iekf"),
          time_offset_(from_seconds(rig.time_offset)),
          report_(report) {}

    void add(const ImuReading& reading) {
        if (!use_imu_) return;
        if (!first_reading_) first_reading_ = reading.t;
        ++report_.imu_readings;
        estimator_.add(reading);
        last_reading_ = reading.t;
        while (!waiting_.empty() && waiting_.front().t + time_offset_ <= last_reading_) release();
    }

    void add(const FeatureFrame& frame) {
        waiting_.push_back(frame);
        if (!use_imu_ || (first_reading_ && frame.t + time_offset_ <= last_reading_)) release();
        while (!patient_ && first_reading_ && !waiting_.empty() &&
               frame.t - waiting_.front().t > MessageQueue<>::kLongestWait)
            release();
    }

    void finish() {
        report_.dropped_images += static_cast<int>(waiting_.size());
        report_.duration_s = to_seconds(last_passed_ - first_passed_);
    }

 private:
    void release() {
        FeatureFrame frame = std::move(waiting_.front());
        waiting_.pop_front();
        if (use_imu_ && frame.t + time_offset_ < *first_reading_) {
            ++report_.dropped_images;
            return;
        }
        if (report_.images++ == 0) first_passed_ = frame.t;
        last_passed_ = frame.t;
        output_.add(frame);
        estimator_.add(frame);
    }

    Estimator& estimator_;
    RunOutput& output_;
    bool use_imu_, patient_;
    TimeNs time_offset_;
    RunReport& report_;
    std::optional<TimeNs> first_reading_;
    TimeNs last_reading_ = 0;
    TimeNs first_passed_ = 0, last_passed_ = 0;
    std::deque<FeatureFrame> waiting_;  // in order of time
};

// Judges the recording's first seconds in passing, once, so that the user learns of a bad recording
// before the work is done.
class EarlyCheck {
 public:
    EarlyCheck(const RunRequest& request, const Rig& rig, RunReport& report)
        : check_(std::in_place, rig, request.use_imu), warn_(request.warn), report_(report) {}

    void add(const Message& message) {
        if (!check_) return;
        check_->add(message);
        if (check_->seconds() > kSeconds) finish();
    }
    void add_tracks(const FeatureFrame& frame) {
        if (check_) check_->add_tracks(frame);
    }
    void finish() {
        if (!check_) return;
        for (Finding& finding : check_->findings(kMostPairs)) {
            if (finding.grade < Grade::warning) continue;
            warn_(finding);
            report_.warnings.push_back(std::move(finding));
        }
        check_.reset();
    }

 private:
    static constexpr double kSeconds = 15;
    static constexpr int kMostPairs = 150;

    std::optional<RecordingCheck> check_;
    std::function<void(const Finding&)> warn_;
    RunReport& report_;
};

// From messages in the order of the file to the results, in the order of time.
class Course {
 public:
    Course(const RunRequest& request, const Rig& rig, bool has_tracks, RunReport& report)
        : front_end_(request.options.tracker, rig, request.use_imu),
          estimator_(make_estimator(request, rig)),
          output_(request, rig),
          feeder_(*estimator_, output_, request, rig, report),
          queue_(from_seconds(request.options.iekf.message_window), request.use_imu),
          early_check_(request, rig, report),
          use_imu_(request.use_imu),
          is_batch_(request.estimator == "batch"),
          has_tracks_(has_tracks),
          time_offset_(from_seconds(rig.time_offset)),
          report_(report) {
        front_end_.set_predictor([this](TimeNs t) { return estimator_->predict(t); });
    }

    void add(const Message& message) {
        early_check_.add(message);
        if (const auto* reading = std::get_if<ImuReading>(&message)) {
            if (use_imu_) queue_.add(*reading);
        } else if (const auto* image = std::get_if<ImageMessage>(&message)) {
            output_.add(*image);
            // Tracks that the rawlog carries stand for its images.
            if (!has_tracks_) queue_.add(TimedMessage{image->t + time_offset_, message});
        } else if (const auto* frame = std::get_if<FeatureFrame>(&message)) {
            queue_.add(TimedMessage{frame->t + time_offset_, message});
        }
        take(false);
    }

    void finish() {
        take(true);
        feed(timed(report_.tracking_s, [&] { return front_end_.finish(); }));
        early_check_.finish();
        feeder_.finish();
        timed(report_.estimation_s, [&] { estimator_->finish(); });
        if (const RefinedRig* refined = estimator_->refined_rig()) {
            // The filter's mount also takes up what its model leaves out: no calibration.
            if (is_batch_) output_.set_rig(refined->rig);
            for (const RefinedRig::Unknown& unknown : refined->unknowns)
                if (unknown.stated_sigma > 0) report_.rig.push_back(unknown);
        }
        write();
        if (output_.scene_due()) timed(report_.picture_s, [&] { output_.write_scene({}); });
        report_.repeated_messages = queue_.repeated();
        report_.late_messages = queue_.late();
    }

    Estimator& estimator() { return *estimator_; }
    RunOutput& output() { return output_; }

 private:
    void take(bool at_end) {
        while (auto next = queue_.pop(at_end)) {
            const auto* reading = std::get_if<ImuReading>(&*next);
            if (reading) timed(report_.estimation_s, [&] { feeder_.add(*reading); });
            const Message message =
                reading ? Message(*reading) : std::move(std::get<TimedMessage>(*next).message);
            feed(timed(report_.tracking_s, [&] { return front_end_.add(message); }));
            front_end_.end_tracks(estimator_->take_rejected());
            write();
            if (output_.scene_due())
                timed(report_.picture_s, [&] { output_.write_scene(estimator_->landmarks()); });
        }
    }

    void feed(const std::vector<FeatureFrame>& frames) {
        for (const FeatureFrame& frame : frames) early_check_.add_tracks(frame);
        timed(report_.estimation_s, [&] {
            for (const FeatureFrame& frame : frames) feeder_.add(frame);
        });
    }

    void write() {
        timed(report_.input_output_s, [&] { output_.add(estimator_->take()); });
    }

    TrackingFrontEnd front_end_;
    std::unique_ptr<Estimator> estimator_;
    RunOutput output_;
    Feeder feeder_;
    MessageQueue<TimedMessage> queue_;
    EarlyCheck early_check_;
    bool use_imu_, is_batch_, has_tracks_;
    TimeNs time_offset_;
    RunReport& report_;
};

// Reads to the end of the part that was asked for, or to where the file is damaged.
void read(Recording& recording, Course& course, Part part, RunReport& report) {
    const auto next = [&]() -> std::optional<Message> {
        try {
            return timed(report.input_output_s, [&] { return recording.next(); });
        } catch (const InputError& damage) {
            report.damage = damage.what();
            return std::nullopt;
        }
    };
    Progress progress("reading");
    while (const std::optional<Message> message = next()) {
        if (part.contains(*message)) course.add(*message);
        if (part.is_over()) break;
        progress.update(recording.progress());
    }
    course.finish();
}

void summarise(const WrittenPath& written, RunReport& report) {
    report.poses = written.poses;
    report.lost_poses = written.lost_poses;
    report.landmarks = written.landmarks;
    report.path_length = written.length;
}

InputError no_pose(const RunRequest& request, const RunReport& report) {
    if (!report.damage.empty()) return InputError(report.damage);
    const std::string why = !report.estimator_says.empty() ? report.estimator_says
                            : report.events.empty()
                                ? "too little to start from; see the images' span"
                                : report.events.back().text;
    const std::string late =
        report.late_messages > 0
            ? "; " + std::to_string(report.late_messages) +
                  " messages came later than iekf.message_window and were left out"
            : "";
    return InputError(request.rawlog + ": no pose could be estimated: " + why + late);
}

nlohmann::json to_json(const RunReport& report, const RunRequest& request) {
    nlohmann::json json;
    json["rawlog"] = request.rawlog;
    json["estimator"] = request.estimator;
    json["sensors"] = request.use_imu ? "image+imu" : "image";
    json["estimator_report"] = report.estimator_says;
    json["events"] = nlohmann::json::array();
    for (const StatusEntry& event : report.events)
        json["events"].push_back({{"t_ns", event.t}, {"text", event.text}});
    json["warnings"] = nlohmann::json::array();
    for (const Finding& finding : report.warnings)
        json["warnings"].push_back(
            {{"grade", to_string(finding.grade)}, {"text", one_line(finding)}});
    json["converged"] = report.converged;
    json["iterations"] = report.iterations;
    if (!report.rig.empty()) json["rig"] = nlohmann::json::array();
    for (const RefinedRig::Unknown& unknown : report.rig)
        json["rig"].push_back(
            {{"name", unknown.name},
             {"unit", unknown.unit},
             {"change", unknown.change},
             {"sigma", unknown.sigma > 0 ? nlohmann::json(unknown.sigma) : nlohmann::json()},
             {"stated_sigma", unknown.stated_sigma}});
    json["imu_readings"] = report.imu_readings;
    json["images"] = report.images_with_pose;
    json["images_in_recording"] = report.images + report.dropped_images;
    json["dropped_images"] = report.dropped_images;
    json["repeated_messages"] = report.repeated_messages;
    json["late_messages"] = report.late_messages;
    json["input_output_s"] = report.input_output_s;
    json["tracking_s"] = report.tracking_s;
    json["estimation_s"] = report.estimation_s;
    if (report.duration_s > 0)
        json["real_time_ratio"] = report.duration_s / (report.tracking_s + report.estimation_s);
    if (!report.damage.empty()) json["damage"] = report.damage;
    return json;
}

}  // namespace

void PipelineOptions::describe(OptionSet& options) {
    tracker.describe(options);
    batch.describe(options);
    iekf.describe(options);
}

RunReport run_pipeline(const RunRequest& request) {
    check_results_folder(request.output, request.overwrite);
    NamedPath truth{request.truth_file,
                    {}};  // read first, so that a bad file is told before long work
    if (!request.truth_file.empty()) truth.poses = read_trajectory(request.truth_file);
    RunReport report;
    Recording recording(request.rawlog, request.recording);
    check_sensors(recording, request);
    Course course(request, recording.rig(), recording.has_features(), report);
    read(recording, course, Part(request), report);
    const Estimator& estimator = course.estimator();
    RunOutput& output = course.output();
    report.estimator_says = estimator.report();
    report.events = estimator.events();
    report.converged = estimator.converged();
    report.iterations = estimator.iterations();
    if (output.written().poses == 0) throw no_pose(request, report);
    report.has_scale = output.has_scale();
    report.images_with_pose = output.images_with_pose();
    timed(report.input_output_s, [&] { output.finish(to_json(report, request)); });
    summarise(output.written(), report);
    report.picture_problem = timed(report.picture_s, [&] { return output.draw(truth); });
    return report;
}

}  // namespace vio::app
