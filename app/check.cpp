// vio-slam check: whether a recording can give a good estimate, before minutes of work.
#include <algorithm>
#include <cstdio>
#include <memory>
#include <optional>

#include "app/commands.h"
#include "app/files.h"
#include "app/pipeline.h"
#include "app/progress.h"
#include "app/recording_text.h"
#include "libvio/check/recording_check.h"
#include "libvio/slam/ordered_messages.h"
#include "libvio/tracking/front_end.h"

namespace vio::app {
namespace {

struct Arguments {
    std::vector<std::string> files;  // [CONFIG] RAWLOG
    std::string rawlog, config;
    RecordingOptions recording;
    std::vector<std::string> assignments;
    double track_s = 60;
};

// Feature tracks of the images of the first so many seconds, without help of the gyro, which is to
// be judged by them.
class Tracks {
 public:
    Tracks(const EstimationOptions& options, const Recording& recording, double seconds)
        : has_tracks_(recording.has_features()),
          seconds_(seconds),
          ordered_(options.iekf.message_window, recording.rig(), false) {
        if (recording.rig().camera) front_end_.emplace(options.tracker, recording.rig(), false);
    }

    std::vector<FeatureFrame> add(const Message& message) {
        const bool wanted = has_tracks_ ? std::holds_alternative<FeatureFrame>(message)
                                        : std::holds_alternative<ImageMessage>(message);
        if (!front_end_ || !wanted) return {};
        ordered_.add(message);
        return take(false);
    }
    std::vector<FeatureFrame> finish() { return take(true); }

 private:
    std::vector<FeatureFrame> take(bool at_end) {
        std::vector<FeatureFrame> frames;
        while (const auto message = ordered_.pop(at_end)) {
            const TimeNs t = time_of(*message);
            if (!first_) first_ = t;
            if (to_seconds(t - *first_) > seconds_) continue;
            for (FeatureFrame& frame : front_end_->add(*message))
                frames.push_back(std::move(frame));
        }
        return frames;
    }

    bool has_tracks_;
    double seconds_;
    OrderedMessages ordered_;
    std::optional<TimeNs> first_;
    std::optional<TrackingFrontEnd> front_end_;
};

Finding file_finding(const std::string& damage) {
    if (damage.empty()) return {Grade::ok, "file", "read to its end", "", ""};
    return {Grade::error, "file", damage, "", "what was read before it is judged below"};
}

std::vector<Finding> judge(const Arguments& arguments, const EstimationOptions& options,
                           Recording& recording) {
    RecordingCheck check(recording.rig(), recording.has_imu());
    Tracks tracks(options, recording, arguments.track_s);
    const auto add_tracks = [&](const std::vector<FeatureFrame>& frames) {
        for (const FeatureFrame& frame : frames) check.add_tracks(frame);
    };
    std::string damage;
    Progress progress("checking");
    try {
        while (const std::optional<Message> message = recording.next()) {
            check.add(*message);
            add_tracks(tracks.add(*message));
            progress.update(recording.progress());
        }
    } catch (const InputError& error) {
        damage = error.what();
    }
    add_tracks(tracks.finish());
    std::vector<Finding> findings = check.findings();
    findings.insert(findings.begin(), file_finding(damage));
    const auto left_out = left_out_findings(recording.left_out());
    findings.insert(findings.begin() + 1, left_out.begin(), left_out.end());
    if (!recording.has_imu())
        findings.push_back(
            {Grade::warning, "IMU", "none in the first 10 s", "",
             "only --sensors image will work, without scale; or name an IMU that begins "
             "later with --imu-label"});
    return findings;
}

void print(const Finding& finding) {
    std::printf("%-9s %-20s %s", to_string(finding.grade), finding.name.c_str(),
                finding.measured.c_str());
    if (!finding.limit.empty()) std::printf("  [%s]", finding.limit.c_str());
    std::printf("\n");
    if (!finding.advice.empty()) std::printf("%-9s %-20s -> %s\n", "", "", finding.advice.c_str());
}

void run(Arguments arguments) {
    sort_files(arguments.files, arguments.config, arguments.rawlog);
    if (arguments.rawlog.empty()) throw InputError("RAWLOG is missing; see vio-slam check --help");
    EstimationOptions options;  // all of a run's, so that its configuration can be given
    OptionSet declared;
    options.describe(declared);
    if (!arguments.config.empty()) declared.load(arguments.config);
    for (const std::string& assignment : arguments.assignments) declared.set(assignment);

    print_streams(arguments.rawlog);
    Recording recording(arguments.rawlog, arguments.recording);
    print_calibration(recording);
    if (!recording.has_images() && !recording.has_features())
        throw InputError(arguments.rawlog +
                         ": no images and no features; name the camera with --camera-label or give "
                         "a rawlog that holds CObservationImage");
    const std::vector<Finding> findings = judge(arguments, options, recording);
    std::printf("\nchecks (measured value, [limit])\n");
    for (const Finding& finding : findings) print(finding);
    const auto count = [&](Grade grade) {
        return std::count_if(findings.begin(), findings.end(),
                             [&](const Finding& f) { return f.grade == grade; });
    };
    const auto errors = count(Grade::error), warnings = count(Grade::warning);
    const auto counted = [](long number, const char* what) {
        return std::to_string(number) + " " + what + (number == 1 ? "" : "s");
    };
    std::printf("\n%s, %s\n", counted(errors, "error").c_str(),
                counted(warnings, "warning").c_str());
    std::fflush(stdout);
    if (errors > 0)
        throw InputError(arguments.rawlog + ": " + counted(errors, "error") +
                         "; an estimate from it is not to be relied on");
}

}  // namespace

void add_check(CLI::App& program) {
    CLI::App* command = program.add_subcommand(
        "check", "Whether a recording can give a good estimate: a verdict on each quantity");
    auto arguments = std::make_shared<Arguments>();
    command
        ->add_option("FILES", arguments->files,
                     "[CONFIG.ini] RAWLOG: MRPT rawlog; with it, if wanted, an INI file with the "
                     "options of a run, of which the tracker's and iekf.message_window count")
        ->required()
        ->expected(1, 2);
    command
        ->add_option("--track", arguments->track_s,
                     "Images are tracked for so long, from the first on [s]")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    command
        ->add_option("--set", arguments->assignments,
                     "One option as tracker.key=value; may be repeated")
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    add_recording_options(*command, arguments->recording);
    command->callback([arguments] { run(*arguments); });
}

}  // namespace vio::app
