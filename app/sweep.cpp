// vio-slam sweep: the program over every combination of some values, as independent processes.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <memory>

#include "app/cells.h"
#include "app/commands.h"
#include "app/measures.h"
#include "app/page.h"
#include "app/progress.h"
#include "libvio/base/errors.h"
#include "libvio/io/text.h"

namespace vio::app {
namespace {

struct Axis {
    std::string name;
    std::vector<std::string> values;
};

// What a configuration file says.
struct Sweep {
    Cell cell;  ///< with {name} where a value goes
    std::vector<std::string> average;
    std::vector<Axis> axes;  ///< the last varies fastest
};

struct Arguments {
    std::string config, output, cell;
    int jobs = 0;
    bool list = false;
};

// A value, or FIRST..LAST for whole numbers.
void append_values(const std::string& text, Axis& axis) {
    const size_t dots = text.find("..");
    const auto first =
        dots == std::string::npos ? std::nullopt : parse_integer(text.substr(0, dots));
    const auto last =
        dots == std::string::npos ? std::nullopt : parse_integer(text.substr(dots + 2));
    if (!first || !last) {
        axis.values.push_back(text);
        return;
    }
    for (std::int64_t i = *first; i <= *last; ++i) axis.values.push_back(std::to_string(i));
}

std::vector<std::string> words(const std::string& text) {
    std::vector<std::string> list;
    std::string word;
    for (const char c : text + ' ') {
        if (c != ' ' && c != '\t') {
            word += c;
        } else if (!word.empty()) {
            list.push_back(word);
            word.clear();
        }
    }
    return list;
}

void take(const std::string& section, const std::string& key, const std::string& value,
          const std::string& where, Sweep& sweep) {
    Cell& cell = sweep.cell;
    const std::map<std::string, std::string*> texts = {
        {"simulate", &cell.simulate}, {"slow", &cell.slow}, {"rawlog", &cell.rawlog},
        {"truth", &cell.truth},       {"run", &cell.run},   {"evaluate", &cell.evaluate}};
    if (section == "vary") {
        Axis axis{key, {}};
        for (const std::string& word : words(value)) append_values(word, axis);
        if (axis.values.empty()) throw InputError(where + key + " has no value");
        sweep.axes.push_back(axis);
    } else if (section == "sweep" && key == "average") {
        sweep.average = words(value);
    } else if (section == "sweep" && texts.count(key)) {
        *texts.at(key) = value;
    } else {
        throw InputError(where + "[" + section + "] " + key +
                         " is not known; see share/formats.md for what a sweep says");
    }
}

Sweep read_sweep(const std::string& file) {
    std::ifstream in(file);
    if (!in) throw InputError(file + ": no such file; check the path");
    Sweep sweep;
    std::string line, section;
    for (int number = 1; std::getline(in, line); ++number) {
        const std::string where = file + " (line " + std::to_string(number) + "): ";
        const std::string text(without_comment(line));
        if (text.empty()) continue;
        if (text[0] == '[' && text.back() == ']') {
            section = text.substr(1, text.size() - 2);
            continue;
        }
        const size_t equals = text.find('=');
        if (equals == std::string::npos) throw InputError(where + "is no `key = value`");
        take(section, std::string(trimmed(text.substr(0, equals))),
             std::string(trimmed(text.substr(equals + 1))), where, sweep);
    }
    if (sweep.cell.simulate.empty() == sweep.cell.rawlog.empty())
        throw InputError(file + ": [sweep] needs either simulate or rawlog");
    if (!sweep.cell.rawlog.empty() && sweep.cell.truth.empty() &&
        sweep.cell.evaluate.find("--against") == std::string::npos)
        throw InputError(file + ": [sweep] needs the truth of its rawlog");
    for (const std::string& name : sweep.average)
        if (std::none_of(sweep.axes.begin(), sweep.axes.end(),
                         [&](const Axis& axis) { return axis.name == name; }))
            throw InputError(file + ": averages over " + name + ", which [vary] does not vary");
    return sweep;
}

using Values = std::vector<std::string>;  ///< one of each axis

std::vector<Values> combinations(const std::vector<Axis>& axes) {
    std::vector<Values> all = {{}};
    for (const Axis& axis : axes) {
        std::vector<Values> longer;
        for (const Values& values : all)
            for (const std::string& value : axis.values) {
                longer.push_back(values);
                longer.back().push_back(value);
            }
        all = std::move(longer);
    }
    return all;
}

Cell cell_of(const Sweep& sweep, const Values& values) {
    Cell cell = sweep.cell;
    for (std::string* text :
         {&cell.simulate, &cell.slow, &cell.rawlog, &cell.truth, &cell.run, &cell.evaluate})
        for (size_t i = 0; i < values.size(); ++i) {
            const std::string name = "{" + sweep.axes[i].name + "}";
            for (size_t at = 0; (at = text->find(name, at)) != std::string::npos;
                 at += values[i].size())
                text->replace(at, name.size(), values[i]);
        }
    return cell;
}

// One row for all cells that differ only in what is averaged over.
Table results(const Sweep& sweep, const std::vector<Values>& all, const CellStore& store) {
    const auto averaged = [&](const Axis& axis) {
        return std::find(sweep.average.begin(), sweep.average.end(), axis.name) !=
               sweep.average.end();
    };
    std::vector<Values> order;
    std::map<Values, std::vector<Outcome>> groups;
    for (const Values& values : all) {
        Values kept;
        for (size_t i = 0; i < values.size(); ++i)
            if (!averaged(sweep.axes[i])) kept.push_back(values[i]);
        if (!groups.count(kept)) order.push_back(kept);
        groups[kept].push_back(store.outcome(cell_of(sweep, values)));
    }
    Table table;
    for (const Axis& axis : sweep.axes)
        if (!averaged(axis)) table.header.push_back(axis.name);
    for (const char* name :
         {"runs", "failed", "completion %", "rotation avg [rad]", "rotation max [rad]",
          "position avg [m]", "position RMSE [m]", "position max [m]", "scale error %",
          "iterations", "time [s]", "first failure"})
        table.header.push_back(name);
    for (const Values& kept : order) {
        const Measures m = measure(groups[kept]);
        std::vector<std::string> row = kept;
        row.push_back(std::to_string(m.runs));
        row.push_back(std::to_string(m.failed));
        const auto add = [&](double value, int digits) {
            row.push_back(m.any() ? fixed(value, digits) : "-");
        };
        add(100 * m.completion, 1);
        add(m.rotation_mean, 4);
        add(m.rotation_max, 4);
        add(m.position_mean, 4);
        add(m.position_rmse, 4);
        add(m.position_max, 4);
        row.push_back(m.scale ? fixed(100 * *m.scale, 2) : "-");
        add(m.iterations, 1);
        add(m.seconds, 2);
        row.push_back(m.message);
        table.rows.push_back(row);
    }
    return table;
}

std::string csv(const Table& table) {
    std::string text;
    const auto add = [&](const std::vector<std::string>& row) {
        for (size_t i = 0; i < row.size(); ++i) {
            std::string cell = row[i];
            std::replace(cell.begin(), cell.end(), ',', ';');
            text += (i ? "," : "") + cell;
        }
        text += '\n';
    };
    add(table.header);
    for (const auto& row : table.rows) add(row);
    return text;
}

void run(const Arguments& arguments) {
    if (!arguments.cell.empty()) {
        run_cell(arguments.cell);
        return;
    }
    if (arguments.config.empty()) throw InputError("CONFIG is missing; see vio-slam sweep --help");
    if (arguments.output.empty())
        throw InputError("--output DIR is missing: the folder for the sweep");
    const Sweep sweep = read_sweep(arguments.config);
    const std::vector<Values> all = combinations(sweep.axes);
    std::vector<Cell> cells;
    for (const Values& values : all) cells.push_back(cell_of(sweep, values));
    const CellStore store(arguments.output);
    if (arguments.list) {
        for (const std::string& line : store.commands(cells)) std::cout << line << "\n";
        return;
    }
    {
        Progress progress("running");
        store.run(cells, arguments.jobs,
                  [&](int done, int of) { progress.update(double(done) / of); });
    }
    const Table table = results(sweep, all, store);
    write_text(arguments.output + "/sweep.csv", csv(table));
    write_text(arguments.output + "/sweep.md", to_markdown(table));
    std::cout << to_markdown(table);
}

}  // namespace

void add_sweep(CLI::App& program) {
    CLI::App* command = program.add_subcommand(
        "sweep", "Run over every combination of some values; what was run before is not run again");
    auto arguments = std::make_shared<Arguments>();
    arguments->jobs = processors();
    command->add_option("CONFIG", arguments->config,
                        "INI file that says what to run and what to vary (share/formats.md)");
    command->add_option("-o,--output", arguments->output,
                        "Folder for recordings, runs and tables (made if missing)");
    command->add_option("--jobs", arguments->jobs, "Processes at a time")
        ->check(CLI::Range(1, 1024))
        ->capture_default_str();
    CLI::Option* list = command->add_flag(
        "--list", arguments->list,
        "Print the command lines of what is still to run, for other machines, and stop");
    command->add_option("--cell", arguments->cell, "Run the one cell in this folder, and stop")
        ->excludes(list);
    command->callback([arguments] { run(*arguments); });
}

}  // namespace vio::app
