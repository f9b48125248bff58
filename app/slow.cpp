// vio-slam slow: a recording of a slower motion, made of a faster one.
#include <cstdio>
#include <memory>

#include "app/commands.h"
#include "app/progress.h"
#include "app/recording_text.h"
#include "libvio/simulation/slow.h"

namespace vio::app {
namespace {

struct Arguments {
    std::string rawlog, output;
    SlowOptions options;
    bool no_noise = false;
};

void run(Arguments arguments) {
    arguments.options.restore_noise = !arguments.no_noise;
    SlowReport report;
    {
        Progress progress("slowing");
        report = slow_rawlog(arguments.rawlog, arguments.output, arguments.options,
                             [&](double share) { progress.update(share); });
    }
    std::printf("%s: %d images, %d feature frames, %d IMU readings (of %d)\n",
                arguments.output.c_str(), report.images, report.feature_frames, report.readings_out,
                report.readings_in);
    print_left_out(report.left_out);
    for (const std::string& file : report.truth_files) std::printf("%s\n", file.c_str());
    if (report.readings_in > 0)
        std::printf(
            "gravity in these readings is 1/%d of the true one: run with --set "
            "batch.gravity_norm=%.6g\n",
            arguments.options.factor * arguments.options.factor, 9.81 * report.gravity_factor);
    std::fflush(stdout);
}

}  // namespace

void add_slow(CLI::App& program) {
    CLI::App* command = program.add_subcommand(
        "slow", "Make a rawlog of a slower motion (Strelow and Singh 2004, section 7.3.2)");
    auto arguments = std::make_shared<Arguments>();
    command->add_option("RAWLOG", arguments->rawlog, "MRPT rawlog to slow")->required();
    command->add_option("-f,--factor", arguments->options.factor, "How many times slower")
        ->check(CLI::Range(2, 1000))
        ->capture_default_str();
    command
        ->add_option("-o,--output", arguments->output,
                     "Rawlog to write; truth that is beside RAWLOG is slowed too, beside it")
        ->required();
    command->add_option("--seed", arguments->options.seed, "Of the noise that is added")
        ->check(CLI::NonNegativeNumber)
        ->capture_default_str();
    command->add_flag("--no-noise", arguments->no_noise,
                      "Do not bring the readings' noise back to the sensor's");
    add_recording_options(*command, arguments->options.recording);
    command->callback([arguments] { run(*arguments); });
}

}  // namespace vio::app
