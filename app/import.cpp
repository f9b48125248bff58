// vio-slam import: data sets of other formats to a rawlog.
#include <iostream>
#include <memory>

#include "app/commands.h"
#include "app/progress.h"
#include "libvio/io/asl_import.h"

namespace vio::app {
namespace {

struct Arguments {
    std::string dir, output;
    AslImportOptions options;
};

void import(const Arguments& arguments) {
    AslImportReport report;
    {
        Progress progress("importing");
        report = import_asl(arguments.dir, arguments.output, arguments.options,
                            [&](double share) { progress.update(share); });
    }
    std::cout << arguments.output << ": " << report.images << " images, " << report.feature_frames
              << " feature frames, " << report.imu_readings << " IMU readings, "
              << to_seconds(report.last - report.first) << " s\n";
    if (!report.truth_file.empty())
        std::cout << report.truth_file << ": " << report.truth_poses << " true poses (T_W_B)\n";
}

}  // namespace

void add_import(CLI::App& program) {
    CLI::App* import_command = program.add_subcommand("import", "Convert a data set to a rawlog");
    import_command->require_subcommand(1);
    CLI::App* asl = import_command->add_subcommand(
        "asl", "EuRoC/ASL folder: camera (images or features), IMU, ground truth");
    auto arguments = std::make_shared<Arguments>();
    asl->add_option("DIR", arguments->dir, "Folder that contains mav0/, or mav0 itself")
        ->required();
    asl->add_option("-o,--output", arguments->output,
                    "Rawlog to write; ground truth goes beside it as NAME.truth.tum")
        ->required();
    asl->add_option("--camera", arguments->options.camera, "Camera folder")->capture_default_str();
    asl->add_option("--imu", arguments->options.imu, "IMU folder")->capture_default_str();
    asl->add_flag("--external-images", arguments->options.external_images,
                  "Leave the images as PNG files in NAME_Images beside the rawlog");
    asl->callback([arguments] { import(*arguments); });
}

}  // namespace vio::app
