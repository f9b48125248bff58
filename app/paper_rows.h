// Rows that set the paper's error metrics beside ours, and paths for its figures.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "app/measures.h"
#include "app/page.h"
#include "app/paper.h"
#include "app/plot.h"

namespace vio::app {

constexpr double kNone = -1e9;  ///< the paper gives no value

/// The paper's values: rad, cm, percent.
struct PaperValues {
    double rotation_mean = kNone, rotation_max = kNone;
    double position_mean = kNone, position_max = kNone;
    double scale = kNone;
    double iterations = kNone;
};

/// Another estimate from the same recordings: what they allow.
struct Yardstick {
    std::string name;
    std::vector<Outcome> outcomes;
};

/// What explains a row that is not as good as the paper's.
struct Reasons {
    std::vector<Yardstick> yardsticks;
    std::string cause;            ///< why the estimate is not as good as a yardstick that is
    std::vector<Outcome> looser;  ///< the same, stopped at kLooseTolerance; for the iterations
};
constexpr const char* kLooseTolerance = "1e-4";

/// A table of such rows under construction.
class Comparison {
 public:
    /// `labels`: headers of the columns that say what a row is of.
    Comparison(std::vector<std::string> labels, bool with_iterations);

    /// One outcome for each recording.
    void add(const std::vector<std::string>& labels, const std::vector<Outcome>& outcomes,
             const PaperValues& paper, const Reasons& reasons = {});
    const Table& table() const { return table_; }
    /// One line for each row of ours that has a figure above the paper's, with what it comes from.
    const std::vector<std::string>& worse() const { return worse_; }

 private:
    bool with_iterations_;
    Table table_;
    std::vector<std::string> worse_;
};

/// Outcomes of cells.
std::vector<Outcome> outcomes(const CellStore& store, const std::vector<Cell>& cells);

/// The paths of a result and of its truth, brought together by similarity, as series of columns a
/// and b (0 x, 1 y, 2 z; 3: seconds). at_s: as of EvaluationOptions; where the truth is at these
/// times is `known`.
struct Paths {
    Series estimate, truth, known;
    bool ok = false;
};
Paths paths(const Outcome& outcome, int a, int b, const std::string& name, int colour,
            const std::vector<double>& at_s = {});

/// Such paths, x to the right and y up.
Plot seen_from_above(const std::string& title, const std::vector<Series>& series);

/// A recording of the scenario with seed 1, 2 ...; further arguments of `simulate` follow.
std::string scenario(const PaperSetup& setup, const std::string& name, int seed,
                     const std::string& arguments = "");

/// A cell for each recording: seeds 1, 2 ...
std::vector<Cell> seeds(const PaperSetup& setup, const std::function<Cell(int)>& cell_of);
void append(std::vector<Cell>& all, const std::vector<Cell>& more);

/// The cell whose run starts from another's result.
Cell started_from(Cell cell, const Cell& start);

constexpr double kArmInterval = 0.84;  ///< between the arm's seven control points [s]
/// When the arm passes them, `interval` apart [s].
std::vector<double> arm_control_times(double interval);
/// Arguments of `evaluate`: the paper's error metrics, at the times [s] of the control points,
/// which are all that it has as truth of the arm (7) and of the crane (11).
std::string at_control_points(const std::vector<double>& at_s);

/// Arguments of `run` as the paper has them. Batch: fixed variances, free gravity, constant biases,
/// no robust loss; 2 px.
std::string paper_batch(const std::string& variance, const std::string& arguments = "");
/// The paper's filter: smooth motion with these variances, started from `prefix` images.
std::string paper_filter(const std::string& rate_variance, const std::string& accel_variance,
                         int prefix);
/// This project's filter, driven by the inertial readings, told of features' errors [px] and that
/// the calibration is exact, as the paper takes it.
std::string own_filter(int prefix, int sigma_px = 2);

/// The exhibits of sections 7, 8, and 9-10.
std::vector<Exhibit> arm_exhibits();
std::vector<Exhibit> omni_exhibits();
std::vector<Exhibit> other_exhibits();

}  // namespace vio::app
