// vio-slam track: the images of a rawlog replaced by feature tracks, so that estimators can be run
// again without them.
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>

#include "app/commands.h"
#include "app/pipeline.h"
#include "app/progress.h"
#include "app/recording_text.h"
#include "libvio/io/rawlog_writer.h"
#include "libvio/slam/ordered_messages.h"
#include "libvio/tracking/front_end.h"

namespace vio::app {
namespace {

struct Arguments {
    std::string rawlog, output, config;
    RecordingOptions recording;
    std::vector<std::string> assignments;
    bool keep_images = false, no_gyro = false;
};

void check(const Arguments& arguments, const Recording& recording) {
    if (!recording.has_images())
        throw InputError(arguments.rawlog +
                         ": no images to track in; give a rawlog that holds CObservationImage, or "
                         "name the camera with --camera-label");
    if (recording.has_features())
        throw InputError(arguments.rawlog +
                         ": holds feature tracks already; give the rawlog that "
                         "they were made from");
    if (!recording.rig().camera)
        throw InputError(arguments.rawlog +
                         ": the camera is not calibrated; give --calibration FILE");
    std::error_code none;
    if (std::filesystem::equivalent(arguments.rawlog, arguments.output, none))
        throw InputError(arguments.output + ": is the input; give another name for the tracks");
}

// What came out, for people.
class Summary {
 public:
    void add(const FeatureFrame& frame) {
        ++images_;
        observations_ += frame.features.size();
        for (const FeatureObservation& feature : frame.features) ++lengths_[feature.feature_id];
    }

    void print(const std::string& file) const {
        std::printf("%s: %d images, %zu tracks", file.c_str(), images_, lengths_.size());
        if (images_ > 0 && !lengths_.empty()) {
            const auto observations = static_cast<double>(observations_);
            std::printf(", %.1f features in an image, each in %.1f images", observations / images_,
                        observations / static_cast<double>(lengths_.size()));
        }
        std::printf("\n");
    }

 private:
    int images_ = 0;
    std::size_t observations_ = 0;
    std::map<FeatureId, int> lengths_;
};

// Returns why reading stopped early; empty if the whole file was read.
std::string track(Recording& recording, OrderedMessages& ordered, TrackingFrontEnd& front_end,
                  bool keep_images, RawlogWriter& writer, Summary& summary) {
    const auto write = [&](const std::vector<FeatureFrame>& frames) {
        for (const FeatureFrame& frame : frames) {
            writer.write(frame);
            summary.add(frame);
        }
    };
    std::string damage;
    Progress progress("tracking");
    const auto next = [&]() -> std::optional<Message> {
        try {
            return recording.next();
        } catch (const InputError& error) {
            damage = error.what();
            return std::nullopt;
        }
    };
    const auto track_ready = [&](bool at_end) {
        while (const auto message = ordered.pop(at_end)) {
            // First what the message completes: it is older.
            write(front_end.add(*message));
            if (keep_images || !std::holds_alternative<ImageMessage>(*message))
                writer.write(*message);
        }
    };
    while (const std::optional<Message> message = next()) {
        if (ordered.add(*message))
            track_ready(false);
        else
            writer.write(*message);
        progress.update(recording.progress());
    }
    track_ready(true);
    write(front_end.finish());
    return damage;
}

void run(const Arguments& arguments) {
    EstimationOptions options;  // all of a run's, so that its options.ini can be given back
    OptionSet declared;
    options.describe(declared);
    if (!arguments.config.empty()) declared.load(arguments.config);
    for (const std::string& assignment : arguments.assignments) declared.set(assignment);

    Recording recording(arguments.rawlog, arguments.recording);
    check(arguments, recording);
    const bool use_gyro = recording.has_imu() && !arguments.no_gyro;
    const double window = options.iekf.message_window;
    OrderedMessages ordered(window, recording.rig(), use_gyro);
    TrackingFrontEnd front_end(options.tracker, recording.rig(), use_gyro);
    RawlogWriter writer(arguments.output, recording.rig(),
                        RawlogWriterOptions::labelled(arguments.recording));
    Summary summary;
    const std::string damage =
        track(recording, ordered, front_end, arguments.keep_images, writer, summary);
    writer.finish();
    summary.print(arguments.output);
    print_left_out(recording.left_out());
    for (const std::string& remark : recording.remarks()) print_note(remark);
    print_repeated(ordered.repeated());
    print_late(ordered.late(), window);
    if (!damage.empty())
        throw InputError(damage + "; the tracks up to there are in " + arguments.output);
}

}  // namespace

void add_track(CLI::App& program) {
    CLI::App* command = program.add_subcommand(
        "track", "Replace a rawlog's images by feature tracks, to estimate again without them");
    auto arguments = std::make_shared<Arguments>();
    command->add_option("RAWLOG", arguments->rawlog, "Rawlog with images")->required();
    command
        ->add_option("-o,--output", arguments->output,
                     "Rawlog to write: features, and all readings of the other sensors")
        ->required();
    command->add_flag("--keep-images", arguments->keep_images,
                      "Write the images too; estimators prefer the tracks");
    command->add_flag("--no-gyro", arguments->no_gyro, "Track without the gyro's prediction");
    command->add_option("--config", arguments->config,
                        "INI file of options; [tracker] and iekf.message_window count");
    command
        ->add_option("--set", arguments->assignments,
                     "One option as tracker.key=value; may be repeated")
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    add_recording_options(*command, arguments->recording);
    command->callback([arguments] { run(*arguments); });
}

}  // namespace vio::app
