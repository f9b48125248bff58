#include "app/pipeline.h"

#include <array>
#include <chrono>
#include <deque>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "app/estimator.h"
#include "app/progress.h"
#include "app/run_output.h"
#include "libvio/io/results.h"
#include "libvio/io/trajectory_io.h"
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
        const double margin = std::holds_alternative<ImuReading>(message) ? 0.1 : 0;
        return seconds >= request_.begin_s - margin && seconds <= request_.end_s + margin;
    }

 private:
    const RunRequest& request_;
    std::optional<TimeNs> origin_;
};

// Tells messages that bear the stamp of the one before of their kind: drivers and lossy links write
// some twice.
class Repeats {
 public:
    bool contains(const Message& message) {
        const TimeNs t = std::visit([](const auto& m) { return m.t; }, message);
        std::optional<TimeNs>& last = last_[message.index()];
        const bool repeated = last == t;
        last = t;
        return repeated;
    }

 private:
    std::array<std::optional<TimeNs>, std::variant_size_v<Message>> last_;
};

// Hands measurements to the estimator. An image outside the IMU's readings cannot be estimated with
// them: it is held back until readings reach it, and dropped if they never do.
class Feeder {
 public:
    Feeder(Estimator& estimator, RunOutput& output, const RunRequest& request, const Rig& rig,
           RunReport& report)
        : estimator_(estimator),
          output_(output),
          use_imu_(request.use_imu),
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
    bool use_imu_;
    TimeNs time_offset_;
    RunReport& report_;
    std::optional<TimeNs> first_reading_;
    TimeNs last_reading_ = 0;
    TimeNs first_passed_ = 0, last_passed_ = 0;
    std::deque<FeatureFrame> waiting_;  // in order of time
};

// Reads to the end of the file, or to where it is damaged.
void read_and_track(Recording& recording, TrackingFrontEnd& front_end, Estimator& estimator,
                    Feeder& feeder, RunOutput& output, Part part, RunReport& report) {
    const auto next = [&] {
        return timed(report.input_output_s, [&] { return recording.next(); });
    };
    const auto feed = [&](const std::vector<FeatureFrame>& frames) {
        timed(report.estimation_s, [&] {
            for (const FeatureFrame& frame : frames) feeder.add(frame);
        });
    };
    Progress progress("reading");
    // Tracks that the rawlog carries stand for its images.
    const bool has_tracks = recording.has_features();
    Repeats repeats;
    try {
        while (const std::optional<Message> message = next()) {
            if (!part.contains(*message)) continue;
            if (repeats.contains(*message)) {
                ++report.repeated_messages;
                continue;
            }
            if (const auto* image = std::get_if<ImageMessage>(&*message)) {
                output.add(*image);
                if (has_tracks) continue;
            }
            if (const auto* reading = std::get_if<ImuReading>(&*message))
                timed(report.estimation_s, [&] { feeder.add(*reading); });
            feed(timed(report.tracking_s, [&] { return front_end.add(*message); }));
            front_end.end_tracks(estimator.take_rejected());
            timed(report.input_output_s, [&] { output.add(estimator.take()); });
            if (output.scene_due())
                timed(report.picture_s, [&] { output.write_scene(estimator.landmarks()); });
            progress.update(recording.progress());
        }
    } catch (const InputError& damage) {
        report.damage = damage.what();
    }
    feed(timed(report.tracking_s, [&] { return front_end.finish(); }));
    feeder.finish();
}

void summarise(const WrittenPath& written, RunReport& report) {
    report.poses = written.poses;
    report.lost_poses = written.lost_poses;
    report.landmarks = written.landmarks;
    report.path_length = written.length;
}

InputError no_pose(const RunRequest& request, const RunReport& report) {
    if (!report.damage.empty()) return InputError(report.damage);
    const std::string why = report.events.empty() ? "too little to start from; see the images' span"
                                                  : report.events.back().text;
    return InputError(request.rawlog + ": no pose could be estimated: " + why);
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
    json["converged"] = report.converged;
    json["iterations"] = report.iterations;
    json["imu_readings"] = report.imu_readings;
    json["images_in_recording"] = report.images + report.dropped_images;
    json["dropped_images"] = report.dropped_images;
    json["repeated_messages"] = report.repeated_messages;
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
    TrackingFrontEnd front_end(request.options.tracker, recording.rig(), request.use_imu);
    const auto estimator = make_estimator(request, recording.rig());
    RunOutput output(request, recording.rig());
    Feeder feeder(*estimator, output, request, recording.rig(), report);

    read_and_track(recording, front_end, *estimator, feeder, output, Part(request), report);
    timed(report.estimation_s, [&] { estimator->finish(); });
    timed(report.input_output_s, [&] { output.add(estimator->take()); });
    if (output.scene_due()) timed(report.picture_s, [&] { output.write_scene({}); });
    report.estimator_says = estimator->report();
    report.events = estimator->events();
    report.converged = estimator->converged();
    report.iterations = estimator->iterations();
    if (output.written().poses == 0) throw no_pose(request, report);
    report.has_scale = output.has_scale();
    timed(report.input_output_s, [&] { output.finish(to_json(report, request)); });
    summarise(output.written(), report);
    report.picture_problem = timed(report.picture_s, [&] { return output.draw(truth); });
    return report;
}

}  // namespace vio::app
