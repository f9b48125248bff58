// vio-slam simulate: a rawlog with known truth from a scenario file.
#include <cstdio>
#include <iostream>
#include <memory>

#include "app/commands.h"
#include "app/progress.h"
#include "libvio/base/angles.h"
#include "libvio/simulation/export.h"

namespace vio::app {
namespace {

struct Arguments {
    std::string scenario, output;
    std::string truth, imu, times;
    std::vector<std::string> assignments;
};

ScenarioOptions scenario_options(const Arguments& arguments) {
    ScenarioOptions options = ScenarioOptions::from_file(arguments.scenario, arguments.assignments);
    if (!arguments.truth.empty()) options.recorded_file = arguments.truth;
    if (!arguments.imu.empty()) options.recorded_imu_file = arguments.imu;
    if (!arguments.times.empty()) options.times_file = arguments.times;
    return options;
}

// How the recorded readings fit the path along which images were made.
void report_recorded_imu(const Simulation& simulation) {
    const SmoothedPath& path = *simulation.smoothed_path();
    std::printf(
        "path        moved by %.3f deg, %.1f mm (rms) to where the readings agree with it; its "
        "frame was tilted by %.2f deg\n",
        path.rotation_rms / kDegree, 1e3 * path.position_rms, path.tilt / kDegree);
    std::printf(
        "readings    residuals of integration between true states, rms, each window with its "
        "first\n"
        "            biases; error squared over its variance (NEES), per degree of freedom\n"
        "            %8s %8s %9s %9s %9s %8s\n",
        "window s", "windows", "deg", "mm", "mm/s", "NEES");
    for (const ImuConsistency& c :
         imu_consistency(simulation.truth(), ImuSequence(simulation.imu()), simulation.rig(),
                         simulation.g_W(), {1, 2, 5, 10, 20, 100}))
        std::printf("            %8.2f %8d %9.4f %9.3f %9.2f %8.2f\n", c.window, c.windows,
                    c.rotation_rms / kDegree, 1e3 * c.position_rms, 1e3 * c.velocity_rms, c.nees);
    std::fflush(stdout);
}

void run(const Arguments& arguments) {
    const Simulation simulation(scenario_options(arguments));
    {
        Progress progress("simulating");
        write_simulation(simulation, arguments.output,
                         [&](double share) { progress.update(share); });
    }
    std::cout << arguments.output << ": " << simulation.image_times().size()
              << (simulation.options().render ? " images, " : " images as feature tracks, ")
              << simulation.imu().size() << (simulation.smoothed_path() ? " recorded" : "")
              << " IMU readings; the truth is beside it" << std::endl;
    if (simulation.smoothed_path()) report_recorded_imu(simulation);
}

}  // namespace

void add_simulate(CLI::App& program) {
    CLI::App* command =
        program.add_subcommand("simulate", "Make a rawlog with known truth from a scenario");
    auto arguments = std::make_shared<Arguments>();
    command->add_option("SCENARIO", arguments->scenario, "Scenario INI file, as in datasets/")
        ->required();
    command
        ->add_option("-o,--output", arguments->output,
                     "Rawlog to write; the truth goes beside it as NAME.truth.tum")
        ->required();
    command->add_option("--truth", arguments->truth,
                        "Recorded path to move along (TUM or EuRoC ground truth), in place of the "
                        "scenario's own");
    command->add_option("--imu", arguments->imu,
                        "Readings recorded along that path (EuRoC imu0/data.csv), in place of "
                        "simulated ones");
    command->add_option("--times", arguments->times,
                        "Stamps of recorded images [ns], one a line, in place of the scenario's "
                        "rate");
    command
        ->add_option("--set", arguments->assignments,
                     "One value of the scenario as section.name=value; may be repeated")
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    command->callback([arguments] { run(*arguments); });
}

}  // namespace vio::app
