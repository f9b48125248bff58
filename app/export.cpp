// vio-slam export: results, and recordings, in the formats of other programs.
#include <iostream>
#include <memory>

#include "app/commands.h"
#include "app/progress.h"
#include "app/recording_text.h"
#include "libvio/base/errors.h"
#include "libvio/io/asl_export.h"
#include "libvio/io/export.h"
#include "libvio/io/ply.h"
#include "libvio/io/results.h"

namespace vio::app {
namespace {

struct Arguments {
    std::string folder, format, output, colour = "image";
    bool ascii = false;
    AslExportOptions asl;
};

void export_recording(const Arguments& arguments) {
    AslExportReport report;
    {
        Progress progress("exporting");
        report = export_asl(arguments.folder, arguments.output, arguments.asl,
                            [&](double share) { progress.update(share); });
    }
    std::cout << arguments.output << "/mav0: " << report.images << " images, "
              << report.feature_frames << " feature frames, " << report.imu_readings
              << " IMU readings, " << report.truth_poses << " true poses\n";
    if (report.left_out > 0)
        std::cout << "left out: " << report.left_out
                  << " odometry and GPS readings, for which the layout has no place\n";
    print_left_out(report.unusable);
}

void run(const Arguments& arguments) {
    if (arguments.format == "asl") return export_recording(arguments);
    const Estimate estimate = read_results(arguments.folder);
    if (arguments.format == "kitti") std::cout << write_kitti(arguments.output, estimate) << "\n";
    if (arguments.format == "euroc") write_euroc(arguments.output, estimate);
    if (arguments.format == "ply")
        write_ply(arguments.output, estimate.landmarks,
                  arguments.colour == "uncertainty" ? LandmarkColour::kUncertainty
                                                    : natural_colour(estimate.landmarks),
                  !arguments.ascii);
    if (arguments.format == "vrml")
        write_vrml(arguments.output, estimate, read_results_rig(arguments.folder).T_B_C);
    std::cout << arguments.output << "\n";
}

}  // namespace

void add_export(CLI::App& program) {
    CLI::App* command = program.add_subcommand(
        "export", "Write a result or a recording in the format of another program");
    auto arguments = std::make_shared<Arguments>();
    command->add_option("RESULT", arguments->folder, "Results folder; for asl a rawlog")
        ->required();
    command
        ->add_option(
            "--as", arguments->format,
            "kitti: poses T_W_B (W: z up, B: the vehicle; not KITTI's camera), with "
            "times in NAME.times.txt; euroc: poses, velocities and biases as CSV; vrml: shape and "
            "motion (VRML 2.0); ply: landmarks; asl: a rawlog as EuRoC/ASL data set")
        ->check(CLI::IsMember({"kitti", "euroc", "vrml", "ply", "asl"}))
        ->required();
    command
        ->add_option(
            "--colour", arguments->colour,
            "Of the landmarks in a PLY: as in the images (where the run had images), or by "
            "uncertainty")
        ->check(CLI::IsMember({"image", "uncertainty"}))
        ->capture_default_str();
    command->add_flag("--ascii", arguments->ascii, "PLY as text; default: binary");
    command
        ->add_option("-o,--output", arguments->output, "File to write; for asl the folder of mav0/")
        ->required();
    add_recording_options(*command, arguments->asl.recording, "asl: ");
    command->add_option("--truth", arguments->asl.truth_file,
                        "asl: true trajectory; default: NAME.truth.tum beside the rawlog");
    command->callback([arguments] { run(*arguments); });
}

}  // namespace vio::app
