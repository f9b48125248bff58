// The unit of sweeps and of the paper's tables: one recording, one run on it, one comparison.
#pragma once

#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace vio::app {

/// What a cell does, as arguments of this program's own commands.
struct Cell {
    std::string simulate;       ///< arguments of `simulate` but the output; empty: rawlog is given
    std::string slow;           ///< arguments of `slow` but input and output; empty: as recorded
    std::string rawlog, truth;  ///< where nothing is simulated
    std::string run;            ///< arguments of `run` but rawlog and output
    std::string evaluate;       ///< arguments of `evaluate` but the result; {rawlog}, {truth} stand
                                ///< for the recording's; without --against: {truth}
    std::shared_ptr<const Cell> start;  ///< whose result the run starts from (--start-from)
};

/// What came of it.
struct Outcome {  // NOLINT(bugprone-exception-escape): JSON values that are moved do not throw
    bool ok = false;
    std::string message;  ///< where it failed: the program's last line
    double seconds = 0;
    nlohmann::json summary;  ///< summary.json of the run; null if it left none
    std::vector<nlohmann::json> evaluations;
    std::string result;         ///< folder of the run's results
    std::string rawlog, truth;  ///< the recording's files
};

/// Processors of this machine.
int processors();

/// Cells under a folder: ROOT/recordings/KEY.* and ROOT/cells/KEY/{cell.json, result/, *.log,
/// outcome.json}. A key tells a cell's arguments, the files that they name and the build of the
/// program, so that outcomes are found again and stale ones are not.
class CellStore {
 public:
    /// Makes the folder if it is missing; throws InputError if it cannot.
    explicit CellStore(const std::string& root);

    /// Runs what is not there yet, each cell as `jobs` processes at a time, those that others
    /// start from first, and calls progress with the number done and the number of all.
    void run(const std::vector<Cell>& cells, int jobs,
             const std::function<void(int, int)>& progress = {}) const;

    /// Command lines that run each cell that is not there yet, in any order and on any machine
    /// that shares the folder.
    std::vector<std::string> commands(const std::vector<Cell>& cells) const;

    /// Throws InputError if the cell has not been run.
    Outcome outcome(const Cell& cell) const;

 private:
    std::string prepared(const Cell& cell) const;
    bool done(const Cell& cell) const;

    std::string root_;
};

/// Runs the one cell whose cell.json lies in the folder, and first the one that it starts from,
/// unless it was run before. A cell that fails is an outcome, not an error.
void run_cell(const std::string& folder);

}  // namespace vio::app
