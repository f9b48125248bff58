// vio-slam reproduce: the paper's tables and figures on simulated recordings.
#include <algorithm>
#include <chrono>
#include <iostream>
#include <memory>

#include "app/commands.h"
#include "app/paper.h"
#include "app/progress.h"
#include "libvio/base/errors.h"
#include "libvio/base/files.h"
#include "libvio/base/timed.h"
#include "libvio/io/text.h"

namespace vio::app {
namespace {

struct Arguments {
    std::vector<std::string> names;
    std::string output = "out/paper";
    PaperSetup setup;
    int jobs = 0;
    bool list = false;
};

constexpr const char* kIntroduction =
    "The tables and figures of D. Strelow and S. Singh, Motion Estimation from Image and Inertial "
    "Measurements, IJRR 23(12), 2004. Their recordings are not public: ours are simulated with the "
    "same statistics (vio-slam statistics), so the figures stand beside each other, never for the "
    "same data. Ours are means over several recordings, the paper's of one. Scale errors of ours "
    "are sizes, since their signs would cancel. Errors are average / maximum after scaled rigid "
    "alignment, Eqs. (26) and (27). The paper knows the place of the arm at seven control points "
    "and of the crane at eleven; so ours are aligned and judged at these, and beside them stands "
    "the translation error over all images, which the paper cannot tell. Below each table stands "
    "what is not as good as the paper's, with the range over single recordings and how many of "
    "them are as good, and what other estimates reach from the same recordings.";

std::vector<Exhibit> chosen(const Arguments& arguments) {
    std::vector<Exhibit> list;
    for (const Exhibit& exhibit : exhibits())
        for (const std::string& name : arguments.names)
            if (name == "all" || name == exhibit.name) {
                list.push_back(exhibit);
                break;
            }
    return list;
}

void run(const Arguments& arguments) {
    if (!is_folder(arguments.setup.datasets))
        throw InputError(arguments.setup.datasets +
                         ": no such folder; name the one that holds the scenarios with --datasets");
    const std::vector<Exhibit> wanted = chosen(arguments);
    std::vector<Cell> cells;
    for (const Exhibit& exhibit : wanted)
        for (const Cell& cell : exhibit.cells(arguments.setup)) cells.push_back(cell);
    const CellStore store(arguments.output);
    if (arguments.list) {
        for (const std::string& line : store.commands(cells)) std::cout << line << "\n";
        return;
    }
    const auto begin = std::chrono::steady_clock::now();
    {
        Progress progress("running");
        store.run(cells, arguments.jobs,
                  [&](int done, int of) { progress.update(double(done) / of); });
    }
    Page page("The paper's experiments");
    page.text(kIntroduction);
    for (const Exhibit& exhibit : wanted) {
        page.heading(exhibit.title);
        const std::vector<std::string> worse = exhibit.show(arguments.setup, store, page);
        page.list("Not as good as the paper, and why", worse);
    }
    const std::string stem =
        arguments.output + "/" + (arguments.names.size() == 1 ? arguments.names[0] : "paper");
    page.write(stem, /*with_markdown=*/true);
    std::cout << read_text(stem + ".md");
    const double seconds = seconds_since(begin);
    std::cout << "page        " << stem << ".html\nruns        " << cells.size() << " in "
              << static_cast<int>(seconds) << " s\n";
}

}  // namespace

void add_reproduce(CLI::App& program) {
    CLI::App* command = program.add_subcommand(
        "reproduce", "Run the paper's experiments; set its tables and figures beside ours");
    auto arguments = std::make_shared<Arguments>();
    arguments->jobs = processors();
    std::vector<std::string> names = {"all"};
    for (const Exhibit& exhibit : exhibits()) names.push_back(exhibit.name);
    command->add_option("NAME", arguments->names, "Tables and figures, or all")
        ->required()
        ->check(CLI::IsMember(names));
    command
        ->add_option("-o,--output", arguments->output,
                     "Folder for recordings, runs and pages; runs found there are kept")
        ->capture_default_str();
    command->add_option("--seeds", arguments->setup.seeds, "Recordings of each experiment")
        ->check(CLI::Range(1, 1000))
        ->capture_default_str();
    command->add_option("--datasets", arguments->setup.datasets, "Folder of the scenarios")
        ->capture_default_str();
    command->add_option("--jobs", arguments->jobs, "Processes at a time")
        ->check(CLI::Range(1, 1024))
        ->capture_default_str();
    command->add_flag("--list", arguments->list,
                      "Print the command lines of what is still to run, for other machines, and "
                      "stop");
    command->callback([arguments] { run(*arguments); });
}

}  // namespace vio::app
