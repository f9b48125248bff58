#include "app/pipeline.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "app/progress.h"
#include "app/recording_text.h"
#include "app/run_output.h"
#include "libvio/base/files.h"
#include "libvio/base/timed.h"
#include "libvio/calibration/board_file.h"
#include "libvio/check/recording_check.h"
#include "libvio/io/results.h"
#include "libvio/io/trajectory_io.h"
#include "libvio/slam/course.h"

namespace vio::app {
namespace {

namespace fs = std::filesystem;

// What a run without a pose has to say; where the file is damaged, that is a reason too.
InputError without_pose(const RunRequest& request, const std::string& damage,
                        const std::string& why) {
    return InputError((damage.empty() ? request.rawlog + ": " : damage + "; from what was read, ") +
                      why);
}

// Reads what is left.
std::string damage_ahead(Recording& recording) {
    try {
        while (recording.next()) {
        }
    } catch (const InputError& damage) {
        return damage.what();
    }
    return "";
}

void check_sensors(Recording& recording, const RunRequest& request) {
    if (!recording.has_images() && !recording.has_features())
        throw without_pose(request, damage_ahead(recording),
                           "no images and no features; name the camera with --camera-label or give "
                           "a rawlog that holds CObservationImage");
    if (!recording.rig().camera)
        throw InputError(request.rawlog +
                         ": the camera is not calibrated; give --calibration FILE");
    if (request.use_imu && !recording.has_imu())
        throw InputError(
            request.rawlog +
            ": no IMU readings in the first 10 s; use --sensors image, or, where they begin later, "
            "name the IMU with --imu-label");
}

// Judges the recording's first seconds in passing, once, so that the user learns of a bad recording
// before the work is done. The seconds are those of the kind of message that runs longest: images
// may end early. A jump of the stamps counts as one.
class EarlyCheck {
 public:
    EarlyCheck(const RunRequest& request, const Rig& rig, RunReport& report)
        : check_(std::in_place, rig, request.use_imu), warn_(request.warn), report_(report) {}

    void add(const Message& message) {
        if (!check_) return;
        check_->add(message);
        Passed& passed = passed_[message.index()];
        const TimeNs t = time_of(message);
        passed.seconds += std::min(1., std::abs(to_seconds(t - passed.last.value_or(t))));
        passed.last = t;
        if (passed.seconds > kSeconds) finish();
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

    struct Passed {
        std::optional<TimeNs> last;
        double seconds = 0;
    };

    std::optional<RecordingCheck> check_;
    std::array<Passed, std::variant_size_v<Message>> passed_;
    std::function<void(const Finding&)> warn_;
    RunReport& report_;
};

EstimationRequest estimation(const RunRequest& request) {
    EstimationRequest wanted{request.estimator, request.use_imu, request.options, {}, {}};
    if (!request.fiducials_file.empty()) wanted.fiducials = read_fiducials(request.fiducials_file);
    if (!request.start_folder.empty()) wanted.start = read_results(request.start_folder);
    return wanted;
}

// The course of the estimate, with what a run looks at and writes on the way.
class Run {
 public:
    Run(const RunRequest& request, const Rig& rig, bool has_tracks, RunReport& report)
        : course_(estimation(request), rig),
          output_(request, rig),
          early_check_(request, rig, report),
          is_batch_(request.estimator == "batch"),
          has_tracks_(has_tracks),
          report_(report) {
        course_.watch_tracked([this](const FeatureFrame& f) { early_check_.add_tracks(f); });
        course_.watch_estimated([this](const FeatureFrame& f) { output_.add(f); });
    }

    void add(const Message& message) {
        early_check_.add(message);
        const auto* image = std::get_if<ImageMessage>(&message);
        if (image) output_.add(*image);
        // Tracks that the rawlog carries stand for its images.
        if (!image || !has_tracks_) course_.add(message);
        take(false);
    }

    void finish() {
        take(true);
        early_check_.finish();
        course_.finish();
        if (const RefinedRig* refined = estimator().refined_rig()) {
            // The filter's mount also takes up what its model leaves out: no calibration.
            if (is_batch_) output_.set_rig(refined->rig);
            for (const RefinedRig::Unknown& unknown : refined->unknowns)
                if (unknown.stated_sigma > 0) report_.rig.push_back(unknown);
        }
        write();
        if (output_.scene_due()) timed(report_.picture_s, [&] { output_.write_scene({}); });
        tell();
    }

    std::string why_no_pose() const { return course_.why_no_pose(); }
    RunOutput& output() { return output_; }

 private:
    void take(bool at_end) {
        while (course_.step(at_end)) {
            write();
            if (output_.scene_due())
                timed(report_.picture_s,
                      [&] { output_.write_scene(estimator().estimate().landmarks); });
        }
    }

    void write() {
        timed(report_.input_output_s, [&] { output_.add(estimator().take()); });
    }

    void tell() {
        const CourseCounts counts = course_.counts();
        report_.images = counts.images;
        report_.dropped_images = counts.dropped_images;
        report_.repeated_messages = counts.repeated_messages;
        report_.late_messages += counts.late_messages;
        report_.late_images += counts.late_images;
        report_.imu_readings = counts.imu_readings;
        report_.duration_s = to_seconds(counts.last_image - counts.first_image);
        report_.covered_s = counts.covered_s;
        report_.estimator_says = estimator().report();
        report_.events = estimator().status();
        report_.converged = estimator().converged();
        report_.iterations = estimator().iterations();
        report_.tracking_s = course_.tracking_s();
        report_.estimation_s = course_.estimation_s();
    }

    Estimator& estimator() { return course_.estimator(); }

    Course course_;
    RunOutput output_;
    EarlyCheck early_check_;
    bool is_batch_, has_tracks_;
    RunReport& report_;
};

// Reads to the end of the part that was asked for, or to where the file is damaged.
void read(Recording& recording, Run& run, Part& part, RunReport& report) {
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
        if (part.contains(*message)) run.add(*message);
        if (part.is_over()) break;
        progress.update(recording.progress());
    }
    report.late_messages += part.late();
    report.late_images += part.late_images();
}

// The folders that a run makes go again with it where it has left nothing in them.
class NewFolders {
 public:
    explicit NewFolders(const std::string& results) {
        const fs::path folder = fs::absolute(results).lexically_normal();
        for (fs::path path = folder / "scenes"; !is_there(path) && path.has_relative_path();
             path = path.parent_path())
            made_.push_back(path);
    }
    ~NewFolders() {
        std::error_code not_empty;
        for (const fs::path& path : made_) fs::remove(path, not_empty);
    }
    NewFolders(const NewFolders&) = delete;
    NewFolders& operator=(const NewFolders&) = delete;

 private:
    std::vector<fs::path> made_;  // the innermost first
};

void tell_left_out(const Recording& recording, const RunRequest& request, RunReport& report) {
    for (const Finding& finding : left_out_findings(recording.left_out())) {
        request.warn(finding);
        report.warnings.push_back(finding);
    }
    for (const std::string& remark : recording.remarks()) request.remark(remark);
}

void summarise(const WrittenPath& written, RunReport& report) {
    report.poses = written.poses;
    report.lost_poses = written.lost_poses;
    report.landmarks = written.landmarks;
    report.path_length = written.length;
    for (const auto& [t, text] : written.shortfalls) report.events.push_back({t, text});
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
    json["images_lost"] = report.images_lost;
    json["images_in_recording"] = report.images + report.dropped_images + report.late_images;
    json["dropped_images"] = report.dropped_images;
    json["repeated_messages"] = report.repeated_messages;
    json["late_messages"] = report.late_messages;
    json["input_output_s"] = report.input_output_s;
    json["tracking_s"] = report.tracking_s;
    json["estimation_s"] = report.estimation_s;
    if (report.covered_s > 0) json["real_time_ratio"] = real_time_ratio(report);
    if (!report.damage.empty()) json["damage"] = report.damage;
    return json;
}

}  // namespace

double real_time_ratio(const RunReport& report) {
    return report.covered_s / (report.tracking_s + report.estimation_s);
}

RunReport run_pipeline(const RunRequest& request) {
    const NewFolders new_folders(request.output);
    check_results_folder(request.output, request.overwrite);
    NamedPath truth{request.truth_file,
                    {}};  // read first, so that a bad file is told before long work
    if (!request.truth_file.empty()) truth.poses = read_trajectory(request.truth_file);
    RunReport report;
    Recording recording(request.rawlog, request.recording);
    check_sensors(recording, request);
    Run run(request, recording.rig(), recording.has_features(), report);
    Part part(request.part, request.options.iekf.message_window);
    read(recording, run, part, report);
    tell_left_out(recording, request, report);
    if (const std::string why = part.why_empty(); !why.empty())
        throw without_pose(request, report.damage, why);
    try {
        run.finish();
    } catch (const InputError& reason) {
        if (report.damage.empty()) throw;
        throw without_pose(request, report.damage, reason.what());
    }
    RunOutput& output = run.output();
    if (output.written().poses == 0) throw without_pose(request, report.damage, run.why_no_pose());
    report.has_scale = output.has_scale();
    report.images_with_pose = output.images_with_pose();
    report.images_lost = output.images_lost();
    timed(report.input_output_s, [&] { output.finish(to_json(report, request)); });
    summarise(output.written(), report);
    report.picture_problem = timed(report.picture_s, [&] { return output.draw(truth); });
    return report;
}

}  // namespace vio::app
