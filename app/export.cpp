// vio-slam export: a result in the formats of other programs.
#include <iostream>
#include <memory>

#include "app/commands.h"
#include "libvio/base/errors.h"
#include "libvio/io/export.h"
#include "libvio/io/results.h"

namespace vio::app {
namespace {

struct Arguments {
    std::string folder, format, output;
};

void run(const Arguments& arguments) {
    const Estimate estimate = read_results(arguments.folder);
    if (arguments.format == "kitti") write_kitti(arguments.output, estimate);
    if (arguments.format == "euroc") write_euroc(arguments.output, estimate);
    if (arguments.format == "ply") write_binary_ply(arguments.output, estimate);
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
                     "motion (VRML 2.0); ply: landmarks, binary")
        ->check(CLI::IsMember({"kitti", "euroc", "vrml", "ply"}))
        ->required();
    command->add_option("-o,--output", arguments->output, "File to write")->required();
    command->callback([arguments] { run(*arguments); });
}

}  // namespace vio::app
