// vio-slam simulate: a rawlog with known truth from a scenario file.
#include <iostream>
#include <memory>

#include "app/commands.h"
#include "app/progress.h"
#include "libvio/simulation/export.h"

namespace vio::app {
namespace {

struct Arguments {
    std::string scenario, output;
    std::vector<std::string> assignments;
};

void run(const Arguments& arguments) {
    ScenarioOptions options = ScenarioOptions::from_file(arguments.scenario);
    OptionSet declared;
    options.describe(declared);
    for (const std::string& assignment : arguments.assignments) declared.set(assignment);
    const Simulation simulation(options);
    {
        Progress progress("simulating");
        write_simulation(simulation, arguments.output,
                         [&](double share) { progress.update(share); });
    }
    std::cout << arguments.output << ": " << simulation.image_times().size() << " images, "
              << simulation.imu().size() << " IMU readings; the truth is beside it\n";
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
    command
        ->add_option("--set", arguments->assignments,
                     "One value of the scenario as section.name=value; may be repeated")
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    command->callback([arguments] { run(*arguments); });
}

}  // namespace vio::app
