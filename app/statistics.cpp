// vio-slam statistics: scenarios in numbers, beside those of the experiments that they imitate.
#include <iostream>
#include <memory>

#include "app/commands.h"
#include "libvio/simulation/scenario.h"
#include "libvio/simulation/statistics.h"

namespace vio::app {
namespace {

struct Arguments {
    std::vector<std::string> scenarios;
    std::vector<std::string> assignments;
};

void run(const Arguments& arguments) {
    bool first = true;
    for (const std::string& file : arguments.scenarios) {
        const Simulation simulation(ScenarioOptions::from_file(file, arguments.assignments));
        std::cout << (first ? "" : "\n") << statistics_table(simulation) << std::flush;
        first = false;
    }
}

}  // namespace

void add_statistics(CLI::App& program) {
    CLI::App* command = program.add_subcommand(
        "statistics", "Compare scenarios with the experiments that they imitate (Markdown tables)");
    auto arguments = std::make_shared<Arguments>();
    command->add_option("SCENARIO", arguments->scenarios, "Scenario INI files, as in datasets/")
        ->required();
    command
        ->add_option("--set", arguments->assignments,
                     "One value of the scenarios as section.name=value; may be repeated")
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    command->callback([arguments] { run(*arguments); });
}

}  // namespace vio::app
