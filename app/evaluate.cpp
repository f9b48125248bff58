// vio-slam evaluate: results against truth, odometry or GPS.
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "app/commands.h"
#include "app/comparison.h"
#include "libvio/io/json_text.h"

namespace vio::app {
namespace {

struct Arguments {
    std::vector<std::string> results;
    ComparisonOptions comparison;
    bool json = false;
};

void run(const Arguments& arguments) {
    const std::vector<Reference> references = read_references(arguments.comparison);
    std::vector<Evaluation> evaluations;
    for (const std::string& name : arguments.results) {
        const JudgedResult result = read_judged(name);
        for (const Reference& reference : references)
            evaluations.push_back(compare(result, reference, arguments.comparison));
    }
    if (arguments.json) {
        auto list = nlohmann::ordered_json::array();
        for (const Evaluation& evaluation : evaluations) list.push_back(to_json(evaluation));
        std::cout << json_text(list.size() == 1 ? list[0] : list);
    } else {
        std::cout << (evaluations.size() == 1 ? to_text(evaluations.front())
                                              : to_table(evaluations));
    }
}

}  // namespace

void add_evaluate(CLI::App& program) {
    CLI::App* command = program.add_subcommand(
        "evaluate", "Compare results with truth, odometry or GPS, beside each other");
    auto arguments = std::make_shared<Arguments>();
    command
        ->add_option("RESULT", arguments->results,
                     "Results folders, or trajectories (TUM, EuRoC, KITTI or MRPT text)")
        ->required();
    add_options(*command, arguments->comparison, /*against_required=*/true);
    command->add_flag("--json", arguments->json,
                      "Machine-readable; several comparisons: a list of them");
    command->callback([arguments] { run(*arguments); });
}

}  // namespace vio::app
