// vio-slam run: the motion behind a rawlog.
#include <cmath>
#include <cstdio>
#include <iostream>
#include <memory>
#include <vector>

#include "app/commands.h"
#include "app/files.h"
#include "app/pipeline.h"
#include "app/recording_text.h"
#include "libvio/base/angles.h"
#include "libvio/base/files.h"
#include "libvio/io/mapping_application.h"

namespace vio::app {
namespace {

struct Arguments {
    RunRequest request;
    std::string sensors = "image+imu", start, config;
    std::vector<std::string> files;  // [CONFIG] RAWLOG
    std::vector<std::string> assignments;
    bool print_options = false, every_reading = false;
};

// What the command line leaves open, from the section of MRPT's SLAM programs.
void apply_mapping_application(const std::string& config, RunRequest& request) {
    const auto keys = read_mapping_application(config);
    if (!keys) return;
    const auto fill = [](std::string& place, const std::string& value) {
        if (place.empty()) place = value;
    };
    fill(request.rawlog, keys->rawlog_file);
    fill(request.output, keys->output_dir);
    fill(request.truth_file, keys->ground_truth_file);
    if (request.scene_every == 0 && keys->save_3d_scenes)
        request.scene_every = keys->save_log_frequency;
}

// Built-in defaults, then the file, then the command line.
void apply_options(Arguments& arguments, OptionSet& options) {
    if (!arguments.config.empty()) options.load(arguments.config);
    for (const std::string& assignment : arguments.assignments) options.set(assignment);
    if (!arguments.start.empty()) arguments.request.options.batch.start = arguments.start;
    if (arguments.every_reading) arguments.request.options.iekf.output = "readings";
}

// Zero stands for one that was not computed.
std::string sigma_text(double sigma) {
    if (sigma == 0) return "unknown";
    char text[32];
    std::snprintf(text, sizeof text, "%.2g", sigma);
    return text;
}

// The filter's: what it holds of the camera's mount, in a line.
void print_mount(const std::vector<RefinedRig::Unknown>& mount) {
    double rotation = 0, position = 0, offset = 0;
    for (const RefinedRig::Unknown& unknown : mount)
        (unknown.unit == "rad" ? rotation
         : unknown.unit == "m" ? position
                               : offset) += unknown.change * unknown.change;
    if (mount.empty()) return;
    std::printf("mount       %.2f deg and %.1f mm from what is stated, clock %.2f ms\n",
                std::sqrt(rotation) / kDegree, 1e3 * std::sqrt(position), 1e3 * std::sqrt(offset));
}

void print_rig(const std::vector<RefinedRig::Unknown>& rig) {
    for (const RefinedRig::Unknown& unknown : rig)
        std::printf("%-12s%-11s %+.4g +- %s %s from what is stated (+- %.2g)\n",
                    &unknown == &rig.front() ? "rig" : "", unknown.name.c_str(), unknown.change,
                    sigma_text(unknown.sigma).c_str(), unknown.unit.c_str(), unknown.stated_sigma);
}

void print(const RunReport& r, const RunRequest& request) {
    std::printf("images      %d over %.2f s, %d IMU readings\n", r.images, r.duration_s,
                r.imu_readings);
    if (r.dropped_images > 0)
        std::printf("dropped     %d images outside the IMU readings\n", r.dropped_images);
    print_repeated(r.repeated_messages);
    print_late(r.late_messages, request.options.iekf.message_window);
    std::printf("estimate    %d poses, path %.2f %s, %d landmarks\n", r.poses, r.path_length,
                r.has_scale ? "m" : "(scale unknown)", r.landmarks);
    if (!r.estimator_says.empty()) std::printf("            %s\n", r.estimator_says.c_str());
    if (request.estimator == "batch")
        print_rig(r.rig);
    else
        print_mount(r.rig);
    for (const StatusEntry& event : r.events)
        std::printf("            %.3f s: %s\n", to_seconds(event.t), event.text.c_str());
    if (r.lost_poses > 0) std::printf("lost        track of %d of these poses\n", r.lost_poses);
    std::printf("time        tracking %.2f s, %s %.2f s, input and output %.2f s", r.tracking_s,
                request.estimator == "batch" ? "batch" : "filter", r.estimation_s,
                r.input_output_s);
    if (r.covered_s > 0) std::printf("; %.1f x real time", real_time_ratio(r));
    std::printf("\nresults     %s\n", request.output.c_str());
    const std::string picture = request.output + "/snapshot.png";
    std::printf("picture     %s\n", is_there(picture) ? picture.c_str() : "none");
    if (!r.picture_problem.empty()) std::printf("            %s\n", r.picture_problem.c_str());
    std::fflush(stdout);
}

void run(Arguments arguments) {
    RunRequest& request = arguments.request;
    sort_files(arguments.files, arguments.config, request.rawlog);
    OptionSet options;
    request.options.describe(options);
    apply_options(arguments, options);
    if (arguments.print_options) {
        std::cout << options.to_ini();
        return;
    }
    if (!arguments.config.empty()) apply_mapping_application(arguments.config, request);
    if (request.rawlog.empty()) throw InputError("RAWLOG is missing; see vio-slam run --help");
    if (request.output.empty())
        throw InputError("--output DIR is missing: the folder for the results");
    if (request.scene_every > 0 && request.estimator != "iekf")
        throw InputError(
            "scenes on the way (--scene-every, SAVE_3D_SCENES) are for --estimator iekf: the batch "
            "estimate comes at the end");
    if (!request.fiducials_file.empty() && request.estimator != "batch")
        throw InputError("--fiducials is for --estimator batch");
    if (!request.start_folder.empty() && request.estimator != "batch")
        throw InputError("--start-from is for --estimator batch");
    if (!arguments.start.empty() && request.estimator != "batch")
        throw InputError("--start is for --estimator batch");
    if (arguments.every_reading && request.estimator != "iekf")
        throw InputError(
            "--every-reading is for --estimator iekf: the batch estimates poses at images");
    check(request.part);
    request.use_imu = arguments.sensors == "image+imu";
    request.warn = [](const Finding& finding) {
        std::printf("%-11s %s\n", to_string(finding.grade), one_line(finding).c_str());
        std::fflush(stdout);
    };
    request.remark = print_note;
    const RunReport report = run_pipeline(request);
    print(report, request);
    if (!report.damage.empty())
        throw InputError(report.damage + "; the results up to there are in " + request.output);
    if (!report.converged)
        throw InputError(request.rawlog + ": the estimate has not converged (" +
                         report.estimator_says + "); what there is is in " + request.output +
                         ", not to be relied on");
}

}  // namespace

void add_run(CLI::App& program) {
    CLI::App* command =
        program.add_subcommand("run", "Estimate motion and structure from a rawlog");
    auto arguments = std::make_shared<Arguments>();
    RunRequest& request = arguments->request;
    command
        ->add_option(
            "FILES", arguments->files,
            "[CONFIG.ini] RAWLOG: MRPT rawlog with images or features, and IMU; before it, "
            "if wanted, an INI file with options, whose [MappingApplication] may name the "
            "rawlog and the output as for MRPT's SLAM programs")
        ->expected(0, 2);
    command->add_option("-o,--output", request.output, "Folder for the results (made if missing)");
    command->add_option("--estimator", request.estimator, "Recursive filter or batch")
        ->check(CLI::IsMember({"iekf", "batch"}))
        ->capture_default_str();
    command->add_option("--sensors", arguments->sensors, "What to estimate from")
        ->check(CLI::IsMember({"image+imu", "image"}))
        ->capture_default_str();
    command
        ->add_option("--start", arguments->start,
                     "Where the batch estimate starts (short for --set batch.start=...)")
        ->check(CLI::IsMember({"auto", "blind", "staged", "iekf"}));
    command
        ->add_option("--start-from", request.start_folder,
                     "Results folder that the batch estimate starts from")
        ->excludes("--start");
    command->add_flag(
        "--every-reading", arguments->every_reading,
        "A pose at every inertial reading too (short for --set iekf.output=readings)");
    command->add_option("--config", arguments->config, "INI file with options");
    command
        ->add_option("--scene-every", request.scene_every,
                     "Write scene and picture into scenes/ after every so many images")
        ->check(CLI::PositiveNumber);
    command
        ->add_option("--set", arguments->assignments,
                     "One option as section.name=value; may be repeated")
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    add_recording_options(*command, request.recording);
    command->add_option("--truth", request.truth_file,
                        "True trajectory (TUM or EuRoC), drawn into the picture");
    add_part_options(*command, request.part);
    command->add_option("--fiducials", request.fiducials_file,
                        "Known points for the batch estimator: rows feature_id,x,y,z[,sigma] [m]");
    command->add_flag("--overwrite", request.overwrite, "Replace results that are in the folder");
    command->add_flag("--print-options", arguments->print_options,
                      "Print every option with unit, range and help, as an INI file, and stop");
    command->callback([arguments] { run(*arguments); });
}

}  // namespace vio::app
