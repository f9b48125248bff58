// vio-slam export: a result in the formats of other programs.
#include <iostream>
#include <memory>

#include "app/commands.h"
#include "libvio/base/errors.h"
#include "libvio/io/export.h"
#include "libvio/io/ply.h"
#include "libvio/io/results.h"

namespace vio::app {
namespace {

struct Arguments {
    std::string folder, format, output, colour = "image";
    bool ascii = false;
};

void run(const Arguments& arguments) {
    const Estimate estimate = read_results(arguments.folder);
    if (arguments.format == "kitti") write_kitti(arguments.output, estimate);
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
    CLI::App* command =
        program.add_subcommand("export", "Write a result in the format of another program");
    auto arguments = std::make_shared<Arguments>();
    command->add_option("RESULT", arguments->folder, "Results folder")->required();
    command
        ->add_option("--as", arguments->format,
                     "kitti: poses; euroc: poses, velocities and biases as CSV; vrml: shape and "
                     "motion (VRML 2.0); ply: landmarks")
        ->check(CLI::IsMember({"kitti", "euroc", "vrml", "ply"}))
        ->required();
    command
        ->add_option(
            "--colour", arguments->colour,
            "Of the landmarks in a PLY: as in the images (where the run had images), or by "
            "uncertainty")
        ->check(CLI::IsMember({"image", "uncertainty"}))
        ->capture_default_str();
    command->add_flag("--ascii", arguments->ascii, "PLY as text; default: binary");
    command->add_option("-o,--output", arguments->output, "File to write")->required();
    command->callback([arguments] { run(*arguments); });
}

}  // namespace vio::app
