// vio-slam sheet: scenarios at a glance.
#include <iostream>
#include <memory>
#include <opencv2/imgcodecs.hpp>

#include "app/commands.h"
#include "app/progress.h"
#include "libvio/simulation/contact_sheet.h"

namespace vio::app {
namespace {

struct Arguments {
    std::vector<std::string> scenarios;
    std::string truth, output;
};

void run(const Arguments& arguments) {
    cv::Mat sheet;
    {
        Progress progress("drawing");
        for (size_t i = 0; i < arguments.scenarios.size(); ++i) {
            ScenarioOptions options = ScenarioOptions::from_file(arguments.scenarios[i]);
            options.tracks = false;
            options.rendering.samples = 3;
            if (!options.recorded_file.empty() && !arguments.truth.empty())
                options.recorded_file = arguments.truth;
            sheet.push_back(contact_strip(Simulation(options)));
            progress.update(static_cast<double>(i + 1) /
                            static_cast<double>(arguments.scenarios.size()));
        }
    }
    bool written = false;
    try {
        written = cv::imwrite(arguments.output, sheet, {cv::IMWRITE_PNG_COMPRESSION, 9});
    } catch (const cv::Exception&) {  // a name that says no format
    }
    if (!written)
        throw InputError(arguments.output +
                         ": cannot be written; let it end in .png and check "
                         "folder and space");
    std::cout << arguments.output << "\n";
}

}  // namespace

void add_sheet(CLI::App& program) {
    CLI::App* command = program.add_subcommand(
        "sheet", "Picture of scenarios: an image, the path from above and from the side");
    auto arguments = std::make_shared<Arguments>();
    command->add_option("SCENARIO", arguments->scenarios, "Scenario INI files, as in datasets/")
        ->required();
    command->add_option("-o,--output", arguments->output, "Picture to write (PNG)")->required();
    command->add_option("--truth", arguments->truth,
                        "Recorded path of the scenarios that follow one");
    command->callback([arguments] { run(*arguments); });
}

}  // namespace vio::app
