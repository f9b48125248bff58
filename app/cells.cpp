#include "app/cells.h"

#include <dlfcn.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <map>
#include <thread>

#include "app/process.h"
#include "libvio/base/errors.h"
#include "libvio/base/files.h"
#include "libvio/base/timed.h"
#include "libvio/io/json_text.h"
#include "libvio/io/recording.h"
#include "libvio/io/text.h"

namespace vio::app {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

json to_json(const Cell& cell) {
    json j = {{"simulate", cell.simulate}, {"slow", cell.slow}, {"rawlog", cell.rawlog},
              {"truth", cell.truth},       {"run", cell.run},   {"evaluate", cell.evaluate}};
    if (cell.start) j["start"] = to_json(*cell.start);
    return j;
}

Cell cell_from(const json& j) {
    Cell cell{j.at("simulate"), j.at("slow"),     j.at("rawlog"), j.at("truth"),
              j.at("run"),      j.at("evaluate"), nullptr};
    if (j.contains("start")) cell.start = std::make_shared<Cell>(cell_from(j["start"]));
    return cell;
}

// FNV-1a.
std::string hash(const std::string& text) {
    std::uint64_t h = 14695981039346656037ULL;
    for (const unsigned char c : text) h = (h ^ c) * 1099511628211ULL;
    char name[17];
    std::snprintf(name, sizeof(name), "%016llx", static_cast<unsigned long long>(h));
    return name;
}

std::string file_stamp(const std::string& file) {
    return std::to_string(fs::file_size(file)) + "@" +
           std::to_string(fs::last_write_time(file).time_since_epoch().count()) + ";";
}

// Tells this build of the program and of the library from others.
std::string build_stamp() {
    std::string stamp = file_stamp(own_program());
    Dl_info info;
    if (dladdr(reinterpret_cast<const void*>(&parse_double), &info) && is_there(info.dli_fname))
        stamp += file_stamp(info.dli_fname);
    return stamp;
}

// State of a file and, of a scenario, of those that it includes.
std::string files_stamp(const fs::path& file, int depth = 0) {
    constexpr int kDeepest = 16;  // files that include each other are refused where they are used
    std::string stamp = file_stamp(file);
    if (file.extension() != ".ini" || depth == kDeepest) return stamp;
    std::ifstream in(file);
    for (std::string line; std::getline(in, line);) {
        const std::string_view text = trimmed(std::string_view(line).substr(0, line.find(" #")));
        const size_t equals = text.find('=');
        if (equals == std::string_view::npos || trimmed(text.substr(0, equals)) != "include")
            continue;
        const fs::path included = file.parent_path() / trimmed(text.substr(equals + 1));
        if (is_file(included)) stamp += files_stamp(included, depth + 1);
    }
    return stamp;
}

// Arguments, and the state of every file that they name.
std::string argument_stamp(const std::string& arguments) {
    std::string stamp = arguments + "\n";
    for (const std::string& argument : split_arguments(arguments))
        if (is_file(argument)) stamp += files_stamp(argument);
    return stamp;
}

std::string recording_key(const Cell& cell) {
    return hash(build_stamp() + argument_stamp(cell.simulate) + cell.slow);
}

std::string cell_key(const Cell& cell) {
    return hash(build_stamp() + json_text(to_json(cell)) + argument_stamp(cell.simulate) +
                argument_stamp(cell.run) + argument_stamp(cell.rawlog) +
                argument_stamp(cell.truth) + argument_stamp(cell.evaluate) +
                (cell.start ? cell_key(*cell.start) : ""));
}

std::string cell_folder(const std::string& root, const Cell& cell) {
    return root + "/cells/" + cell_key(cell);
}

// Held while one process makes what others may want too.
class Lock {
 public:
    explicit Lock(const std::string& file)
        : handle_(open(file.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0644)) {
        if (handle_ < 0) throw InputError(file + ": cannot be written");
        flock(handle_, LOCK_EX);
    }
    ~Lock() { close(handle_); }
    Lock(const Lock&) = delete;
    Lock& operator=(const Lock&) = delete;

 private:
    int handle_;
};

std::string last_line(const std::string& file) {
    const std::string text(trimmed(read_text(file)));
    return text.substr(text.find_last_of('\n') + 1);
}

// A step of a cell that did not work: becomes its outcome.
struct StepFailed {
    std::string message;
};

void step(std::vector<std::string> command, const std::string& log_file) {
    command.insert(command.begin(), own_program());
    const int code = run_process(command, log_file);
    if (code == 0) return;
    std::string line = last_line(log_file);
    const std::string prefix = "vio-slam: error: ";
    if (line.rfind(prefix, 0) == 0) line.erase(0, prefix.size());
    throw StepFailed{line.empty() ? "killed" : line};
}

struct RecordingFiles {
    std::string rawlog, truth;
};

RecordingFiles files_of(const Cell& cell, const std::string& root) {
    if (cell.simulate.empty()) return {cell.rawlog, cell.truth};
    const std::string stem = root + "/recordings/" + recording_key(cell);
    return {stem + ".rawlog", stem + ".truth.tum"};
}

// The cell's recording, made now or before.
RecordingFiles recording(const Cell& cell, const std::string& root) {
    const RecordingFiles files = files_of(cell, root);
    if (cell.simulate.empty()) return files;
    Cell made = cell;
    std::string input;
    if (!cell.slow.empty()) {
        made.slow.clear();
        input = recording(made, root).rawlog;
    }
    const std::string stem = files.rawlog.substr(0, files.rawlog.rfind('.'));
    const Lock lock(stem + ".lock");
    if (is_there(stem + ".done")) return files;
    std::vector<std::string> command = {input.empty() ? "simulate" : "slow"};
    if (!input.empty()) command.push_back(input);
    for (const std::string& a : split_arguments(input.empty() ? cell.simulate : cell.slow))
        command.push_back(a);
    command.insert(command.end(), {"-o", files.rawlog});
    step(command, stem + ".log");
    write_text(stem + ".done", "");
    return files;
}

void replace_all(std::string& text, const std::string& what, const std::string& by) {
    for (size_t at = 0; (at = text.find(what, at)) != std::string::npos; at += by.size())
        text.replace(at, what.size(), by);
}

void run_steps(const Cell& cell, const std::string& root, const std::string& folder,
               Outcome& outcome) {
    const RecordingFiles files = recording(cell, root);
    std::vector<std::string> command = {"run", files.rawlog, "-o", outcome.result, "--overwrite"};
    for (const std::string& a : split_arguments(cell.run)) command.push_back(a);
    if (cell.start) {
        const std::string start = cell_folder(root, *cell.start) + "/result";
        if (!is_there(start + "/trajectory.tum"))
            throw StepFailed{"the run to start from has failed"};
        command.insert(command.end(), {"--start-from", start});
    }
    fs::remove_all(outcome.result);
    step(command, folder + "/run.log");
    outcome.summary = json::parse(read_text(outcome.result + "/summary.json"));

    std::string arguments = cell.evaluate;
    if (arguments.find("--against") == std::string::npos) arguments += " --against {truth}";
    replace_all(arguments, "{rawlog}", files.rawlog);
    replace_all(arguments, "{truth}", files.truth);
    command = {"evaluate", outcome.result, "--json"};
    for (const std::string& a : split_arguments(arguments)) command.push_back(a);
    step(command, folder + "/evaluate.log");
    const json evaluations = json::parse(read_text(folder + "/evaluate.log"));
    if (evaluations.is_array())
        outcome.evaluations = evaluations.get<std::vector<json>>();
    else
        outcome.evaluations = {evaluations};
}

// Each cell once, with those that they start from before them.
void collect(const Cell& cell, std::vector<std::vector<Cell>>& waves,
             std::map<std::string, size_t>& seen) {
    size_t depth = 0;
    for (const Cell* c = cell.start.get(); c; c = c->start.get()) ++depth;
    if (cell.start) collect(*cell.start, waves, seen);
    if (!seen.emplace(cell_key(cell), depth).second) return;
    if (waves.size() <= depth) waves.resize(depth + 1);
    waves[depth].push_back(cell);
}

}  // namespace

CellStore::CellStore(const std::string& root) {
    std::error_code error;
    fs::create_directories(root + "/recordings", error);
    if (!error) fs::create_directories(root + "/cells", error);
    if (error) throw InputError(root + ": cannot be made: " + error.message());
    root_ = fs::absolute(root).lexically_normal().string();
    while (root_.ends_with('/')) root_.pop_back();
}

std::string CellStore::prepared(const Cell& cell) const {
    const std::string folder = cell_folder(root_, cell);
    fs::create_directories(folder);
    if (cell.start) prepared(*cell.start);
    if (!is_there(folder + "/cell.json"))
        write_text(folder + "/cell.json", json_text(to_json(cell)));
    return folder;
}

bool CellStore::done(const Cell& cell) const {
    return is_there(cell_folder(root_, cell) + "/outcome.json");
}

void CellStore::run(const std::vector<Cell>& cells, int jobs,
                    const std::function<void(int, int)>& progress) const {
    std::vector<std::vector<Cell>> waves;
    std::map<std::string, size_t> seen;
    for (const Cell& cell : cells) collect(cell, waves, seen);
    int count = 0;
    const auto tell = [&] {
        if (progress) progress(count, static_cast<int>(seen.size()));
    };
    for (const std::vector<Cell>& wave : waves) {
        int running = 0;
        const auto wait_for_one = [&] {
            while (waitpid(-1, nullptr, 0) < 0 && errno == EINTR) continue;
            --running, ++count;
            tell();
        };
        for (const Cell& cell : wave) {
            if (done(cell)) {
                ++count;
                continue;
            }
            if (running == jobs) wait_for_one();
            const std::string folder = prepared(cell);
            start_process({own_program(), "sweep", "--cell", folder}, folder + "/cell.log",
                          /*single_thread=*/true);
            ++running;
        }
        while (running > 0) wait_for_one();
        tell();
    }
}

std::vector<std::string> CellStore::commands(const std::vector<Cell>& cells) const {
    std::vector<std::vector<Cell>> waves;
    std::map<std::string, size_t> seen;
    for (const Cell& cell : cells) collect(cell, waves, seen);
    std::vector<std::string> list;
    for (const std::vector<Cell>& wave : waves)
        for (const Cell& cell : wave)
            if (!done(cell))
                list.push_back(shell_text({own_program(), "sweep", "--cell", prepared(cell)}));
    return list;
}

Outcome CellStore::outcome(const Cell& cell) const {
    const std::string folder = cell_folder(root_, cell);
    if (!done(cell))
        throw InputError(folder + ": the cell has not been run; see " + folder + "/cell.log");
    const json j = json::parse(read_text(folder + "/outcome.json"));
    const RecordingFiles files = files_of(cell, root_);
    return {j.at("ok"),
            j.at("message"),
            j.at("seconds"),
            j.at("summary"),
            j.at("evaluations").get<std::vector<json>>(),
            folder + "/result",
            files.rawlog,
            files.truth};
}

int processors() {
    return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

void run_cell(const std::string& folder) {
    if (!is_there(folder + "/cell.json"))
        throw InputError(folder + ": holds no cell.json; see vio-slam sweep --list");
    const Cell cell = cell_from(json::parse(read_text(folder + "/cell.json")));
    const std::string root = fs::path(folder).parent_path().parent_path().string();
    if (cell.start) run_cell(cell_folder(root, *cell.start));
    const Lock lock(folder + "/lock");
    if (is_there(folder + "/outcome.json")) return;
    Outcome outcome;
    outcome.result = folder + "/result";
    const auto begin = std::chrono::steady_clock::now();
    try {
        run_steps(cell, root, folder, outcome);
        outcome.ok = true;
    } catch (const StepFailed& failure) {
        outcome.message = failure.message;
    }
    outcome.seconds = seconds_since(begin);
    write_text(folder + "/outcome.json", json_text(json({{"ok", outcome.ok},
                                                         {"message", outcome.message},
                                                         {"seconds", outcome.seconds},
                                                         {"summary", outcome.summary},
                                                         {"evaluations", outcome.evaluations}})));
}

}  // namespace vio::app
