// The perspective arm experiment: Tables 1, 2, 4, 5, 6, 7 and Figs. 8, 10 (section 7).
#include <cmath>

#include "app/paper_rows.h"

namespace vio::app {
namespace {

// The variances that the paper adopts for its filter.
constexpr const char* kRate = "1e-2";
constexpr const char* kAccel = "1e4";
constexpr const char* kSim3 = "--align sim3";

constexpr const char* kVariances[] = {"1e-8", "1e-7", "1e-6", "1e-5", "1e-4", "1e-3"};

std::vector<Cell> seeds(const PaperSetup& setup, const std::function<Cell(int)>& cell_of) {
    std::vector<Cell> cells;
    for (int seed = 1; seed <= setup.seeds; ++seed) cells.push_back(cell_of(seed));
    return cells;
}

void append(std::vector<Cell>& all, const std::vector<Cell>& more) {
    all.insert(all.end(), more.begin(), more.end());
}

Cell arm(const PaperSetup& setup, int seed, const std::string& run) {
    Cell cell;
    cell.simulate = scenario(setup, "perspective_arm", seed);
    cell.run = run;
    cell.evaluate = kSim3;
    return cell;
}

Cell started_from(Cell cell, const Cell& start) {
    cell.start = std::make_shared<Cell>(start);
    return cell;
}

// A recording slowed by the procedure of section 7.3.2, which divides gravity by the factor
// squared.
Cell slowed(Cell cell, int factor, int seed) {
    if (factor == 1) return cell;
    cell.slow = "--factor " + std::to_string(factor) + " --seed " + std::to_string(seed);
    cell.run += " --set batch.gravity_norm=" + fixed(9.81 / (factor * factor), 6);
    return cell;
}

Measures measured(const CellStore& store, const std::vector<Cell>& cells) {
    return measure(outcomes(store, cells));
}

// --- Table 1 and Fig. 8

enum class Start { kAccurate, kPoor, kBlind };
constexpr Start kStarts[] = {Start::kAccurate, Start::kPoor, Start::kBlind};
constexpr const char* kStartNames[] = {"accurate recursive", "poor recursive", "blind"};

// Accurate: the filter of this project. Poor: qualitatively right, by variances out of place.
std::vector<Cell> table1_cells(const PaperSetup& setup, const std::string& variance, Start start) {
    return seeds(setup, [&](int seed) {
        if (start == Start::kBlind) return arm(setup, seed, paper_batch(variance, "--start blind"));
        const std::string filter =
            start == Start::kAccurate ? own_filter(40) : paper_filter("1e6", "1e2", 40);
        return started_from(arm(setup, seed, paper_batch(variance)), arm(setup, seed, filter));
    });
}

std::vector<Cell> default_batch(const PaperSetup& setup) {
    return seeds(setup, [&](int seed) {
        return arm(setup, seed, "--estimator batch --set batch.sigma_px=2");
    });
}

// Image-only, from the image-and-inertial estimate of 1e-5.
Cell image_only(const Cell& start) {
    Cell cell = start;
    cell.run =
        "--estimator batch --sensors image --set batch.sigma_px=2 --set batch.loss=none"
        " --set batch.max_iterations=500";
    return started_from(cell, start);
}

std::vector<Cell> table1_image_only(const PaperSetup& setup) {
    std::vector<Cell> cells = table1_cells(setup, "1e-5", Start::kAccurate);
    for (Cell& cell : cells) cell = image_only(cell);
    return cells;
}

struct Table1Row {
    PaperValues values;  // from any start that converged
    double iterations[3];
};
const Table1Row kTable1[] = {
    {{.13, .20, 3.3, 5.3, -6.4}, {3, 5, 201}},     {{.10, .16, 3.1, 4.9, -6.0}, {3, 5, 163}},
    {{.09, .14, 2.6, 3.9, -6.7}, {3, 5, 69}},      {{.09, .14, 2.3, 2.9, -8.2}, {4, 5, 209}},
    {{.09, .12, 2.7, 3.7, -13.4}, {5, 10, kNone}}, {{.12, .17, 8.9, 15.5, -29.3}, {23, 23, kNone}},
};

std::vector<Cell> all_table1(const PaperSetup& setup) {
    std::vector<Cell> all = default_batch(setup);
    for (const char* variance : kVariances)
        for (const Start start : kStarts) append(all, table1_cells(setup, variance, start));
    append(all, table1_image_only(setup));
    return all;
}

std::vector<std::string> show_table1(const PaperSetup& setup, const CellStore& store, Page& page) {
    Comparison comparison({"variances", "initial estimate"}, /*with_iterations=*/true);
    for (size_t v = 0; v < std::size(kVariances); ++v)
        for (size_t s = 0; s < std::size(kStarts); ++s) {
            PaperValues paper = kTable1[v].values;
            paper.iterations = kTable1[v].iterations[s];
            if (paper.iterations == kNone) paper = {};
            comparison.add({kVariances[v], kStartNames[s]},
                           measured(store, table1_cells(setup, kVariances[v], kStarts[s])), paper);
        }
    comparison.add({"image only", "batch 1e-5"}, measured(store, table1_image_only(setup)),
                   {.47, .60, 19.0, 32.6, kNone, kNone});
    comparison.add({"propagated", "staged"}, measured(store, default_batch(setup)), {});
    page.table(comparison.table());
    page.text(
        "Errors are average / maximum. Last row: weights from the noise densities, this "
        "project's default, which the paper does not have.");
    return comparison.worse();
}

std::vector<std::string> show_fig8(const PaperSetup& setup, const CellStore& store, Page& page) {
    Series mean, max, paper_mean, paper_max;
    mean.name = "average", max.name = "maximum";
    paper_mean.name = "paper, average", paper_max.name = "paper, maximum";
    mean.colour = max.colour = 1, paper_mean.colour = paper_max.colour = 2;
    for (Series* s : {&mean, &paper_mean}) s->style = Series::kLinePoints;
    for (Series* s : {&max, &paper_max}) s->style = Series::kDashed;
    std::vector<std::string> worse;
    for (size_t v = 0; v < std::size(kVariances); ++v) {
        const Measures m = measured(store, table1_cells(setup, kVariances[v], Start::kAccurate));
        const double x = static_cast<double>(v) - 8;
        for (Series* s : {&mean, &max, &paper_mean, &paper_max}) s->x.push_back(x);
        mean.y.push_back(m.any() ? 100 * m.position_mean : NAN);
        max.y.push_back(m.any() ? 100 * m.position_max : NAN);
        paper_mean.y.push_back(kTable1[v].values.position_mean);
        paper_max.y.push_back(kTable1[v].values.position_max);
        if (!(mean.y.back() <= paper_mean.y.back() && max.y.back() <= paper_max.y.back()))
            worse.push_back(std::string(kVariances[v]) + ": translation");
    }
    Plot plot;
    plot.x_label = "log10 of the inertial error function's variances";
    plot.y_label = "translation error [cm]";
    plot.whole_x = true;
    plot.series = {mean, max, paper_mean, paper_max};
    page.plots("fig8", draw({plot}), "From the accurate initial estimate.");
    return worse;
}

// --- Table 2: slowed recordings, batch; Table 7: the same, filter

constexpr int kFactors[] = {1, 2, 4, 8};

std::vector<Cell> table2_cells(const PaperSetup& setup, int factor, const std::string& variance) {
    return seeds(setup, [&](int seed) {
        const auto at = [&](const std::string& run) {
            return slowed(arm(setup, seed, run), factor, seed);
        };
        return started_from(at(paper_batch(variance)), at(own_filter(40)));
    });
}

const PaperValues kTable2[4][3] = {
    {{.09, .14, 2.6, 3.9, -6.7, 3}, {.09, .14, 2.3, 2.9, -8.2, 4}, {.09, .12, 2.7, 3.7, -13.4, 5}},
    {{.09, .12, 2.4, 3.3, -9.1, 4}, {.11, .17, 2.3, 3.0, -14.9, 4}, {.13, .18, 3.4, 5.4, -19.7, 6}},
    {{.13, .19, 2.7, 3.3, -14.1, 7},
     {.24, .30, 5.6, 8.4, -29.0, 16},
     {.37, .41, 8.8, 12.7, -37.0, 30}},
    {{.17, .25, 4.5, 6.7, -22.2, 59},
     {.24, .33, 7.4, 11.3, -34.8, 8},
     {.43, .47, 10.7, 14.6, -44.9, 116}}};

std::vector<Cell> all_table2(const PaperSetup& setup) {
    std::vector<Cell> all;
    for (const int factor : kFactors)
        for (size_t v = 0; v < 3; ++v) append(all, table2_cells(setup, factor, kVariances[v + 2]));
    return all;
}

std::vector<std::string> show_table2(const PaperSetup& setup, const CellStore& store, Page& page) {
    Comparison comparison({"slowdown", "variances"}, /*with_iterations=*/true);
    for (size_t f = 0; f < std::size(kFactors); ++f)
        for (size_t v = 0; v < 3; ++v)
            comparison.add({std::to_string(kFactors[f]), kVariances[v + 2]},
                           measured(store, table2_cells(setup, kFactors[f], kVariances[v + 2])),
                           kTable2[f][v]);
    page.table(comparison.table());
    return comparison.worse();
}

std::vector<Cell> table7_cells(const PaperSetup& setup, int factor, const std::string& run) {
    return seeds(setup, [&](int seed) { return slowed(arm(setup, seed, run), factor, seed); });
}

std::vector<Cell> all_table7(const PaperSetup& setup) {
    std::vector<Cell> all;
    for (const int factor : kFactors) {
        append(all, table7_cells(setup, factor, paper_filter(kRate, kAccel, 40)));
        append(all, table7_cells(setup, factor, own_filter(40)));
    }
    return all;
}

std::vector<std::string> show_table7(const PaperSetup& setup, const CellStore& store, Page& page) {
    const PaperValues paper[] = {{.10, .15, 3.4, 4.5, 0.6},
                                 {.12, .16, 3.7, 4.8, 0.7},
                                 {.17, .21, 3.2, 5.3, -10.9},
                                 {.13, .16, 5.4, 8.0, -9.3}};
    Comparison comparison({"slowdown", "filter"}, false);
    for (size_t f = 0; f < std::size(kFactors); ++f) {
        const std::string factor = std::to_string(kFactors[f]);
        comparison.add(
            {factor, "smooth"},
            measured(store, table7_cells(setup, kFactors[f], paper_filter(kRate, kAccel, 40))),
            paper[f]);
        comparison.add({factor, "imu-driven"},
                       measured(store, table7_cells(setup, kFactors[f], own_filter(40))), paper[f]);
    }
    page.table(comparison.table());
    return comparison.worse();
}

// --- Table 4: image-only against noise and intrinsics

enum class Perturbed { kNothing, kIntrinsics, kProjections };

Cell table4_cell(const PaperSetup& setup, Perturbed perturbed, int trial) {
    Cell cell;
    const std::string name =
        perturbed == Perturbed::kIntrinsics ? "perspective_arm_perturbed" : "perspective_arm";
    cell.simulate = scenario(setup, name, trial,
                             perturbed == Perturbed::kProjections ? "" : "--set tracks.noise=0");
    cell.run = paper_batch("1e-5");
    cell.evaluate = kSim3;
    cell = image_only(cell);
    // What is left of the error of exact data is how far the minimisation goes.
    if (perturbed == Perturbed::kNothing) cell.run += " --set batch.cost_tolerance=1e-12";
    return cell;
}

const PaperValues kTable4[] = {
    {3.4e-6, 1.1e-5, 3.3e-6, 9.6e-6}, {.032, .056, 1.0, 2.5}, {.030, .037, 1.3, 2.7},
    {.094, .130, 3.0, 8.0},           {.046, .070, 1.5, 4.0}, {.028, .043, 1.3, 2.8},
    {.27, .60, 22.9, 60.1},           {.19, .57, 21.0, 53.2}, {.42, 1.07, 34.4, 70.3},
    {.57, .90, 29.8, 59.2},           {.32, .66, 17.7, 61.5}};

Perturbed table4_kind(int trial) {
    return trial == 1 ? Perturbed::kNothing
                      : (trial <= 6 ? Perturbed::kIntrinsics : Perturbed::kProjections);
}

std::vector<Cell> all_table4(const PaperSetup& setup) {
    std::vector<Cell> all;
    for (int trial = 1; trial <= 11; ++trial)
        all.push_back(table4_cell(setup, table4_kind(trial), trial));
    return all;
}

std::vector<std::string> show_table4(const PaperSetup& setup, const CellStore& store, Page& page) {
    Comparison comparison({"trial", "intrinsics", "projections"}, false);
    for (int trial = 1; trial <= 11; ++trial) {
        const Perturbed kind = table4_kind(trial);
        comparison.add(
            {std::to_string(trial), kind == Perturbed::kIntrinsics ? "perturbed" : "true",
             kind == Perturbed::kProjections ? "2 px noise" : "exact"},
            measured(store, {table4_cell(setup, kind, trial)}), kTable4[trial - 1]);
    }
    page.table(comparison.table());
    page.text(
        "Each trial is one recording; the paper perturbs one recording anew for each. Image "
        "only, without scale, from the image-and-inertial estimate.");
    return comparison.worse();
}

// --- Table 5 and Fig. 10

constexpr const char* kPropagation[] = {"1e-2", "1e0", "1e2", "1e4", "1e6"};
const PaperValues kTable5[5][5] = {{{.25, kNone, 8.4, kNone, -3.0},
                                    {.12, kNone, 4.2, kNone, -3.1},
                                    {.11, kNone, 4.0, kNone, -2.8},
                                    {.10, kNone, 3.4, kNone, 0.6},
                                    {.12, kNone, 3.5, kNone, -0.3}},
                                   {{.25, kNone, 8.3, kNone, -1.3},
                                    {.13, kNone, 4.2, kNone, -2.9},
                                    {.11, kNone, 3.9, kNone, -2.6},
                                    {.10, kNone, 3.5, kNone, 0.9},
                                    {.12, kNone, 3.6, kNone, -0.1}},
                                   {{.4, kNone, 14.0, kNone, 16.7},
                                    {.14, kNone, 3.8, kNone, -4.3},
                                    {.13, kNone, 3.5, kNone, -4.7},
                                    {.10, kNone, 3.5, kNone, -0.07},
                                    {.11, kNone, 4.0, kNone, 1.3}},
                                   {{},
                                    {.22, kNone, 5.0, kNone, -8.1},
                                    {.20, kNone, 5.1, kNone, -9.2},
                                    {.13, kNone, 3.6, kNone, -3.0},
                                    {.26, kNone, 10.7, kNone, -24.0}},
                                   {{.30, kNone, 13.0, kNone, 1.4},
                                    {.32, kNone, 14.3, kNone, 8.7},
                                    {.18, kNone, 5.8, kNone, -7.6},
                                    {.13, kNone, 4.0, kNone, -2.5},
                                    {.54, kNone, 13.4, kNone, 14.9}}};

std::vector<Cell> filter_cells(const PaperSetup& setup, const std::string& run) {
    return seeds(setup, [&](int seed) { return arm(setup, seed, run); });
}

std::vector<Cell> all_table5(const PaperSetup& setup) {
    std::vector<Cell> all = filter_cells(setup, own_filter(40));
    for (const char* rate : kPropagation)
        for (const char* accel : kPropagation)
            append(all, filter_cells(setup, paper_filter(rate, accel, 40)));
    return all;
}

std::vector<std::string> show_table5(const PaperSetup& setup, const CellStore& store, Page& page) {
    Comparison comparison({"omega variance", "a variance"}, false);
    for (size_t w = 0; w < 5; ++w)
        for (size_t a = 0; a < 5; ++a)
            comparison.add({kPropagation[w], kPropagation[a]},
                           measured(store, filter_cells(setup, paper_filter(kPropagation[w],
                                                                            kPropagation[a], 40))),
                           kTable5[w][a]);
    PaperValues best = kTable5[0][3];
    comparison.add({"imu-driven", "none to choose"},
                   measured(store, filter_cells(setup, own_filter(40))), best);
    page.table(comparison.table());
    page.text("Last row: this project's default filter, beside the paper's best.");
    return comparison.worse();
}

std::vector<std::string> show_fig10(const PaperSetup& setup, const CellStore& store, Page& page) {
    Plot plot;
    plot.x_label = "log10 of the linear acceleration propagation variance";
    plot.y_label = "average translation error [cm]";
    plot.whole_x = true;
    const int shown[] = {0, 2, 4};
    for (int k = 0; k < 3; ++k) {
        const size_t w = static_cast<size_t>(shown[k]);
        Series ours, paper;
        ours.name = std::string("omega ") + kPropagation[w];
        paper.name = std::string("paper, ") + kPropagation[w];
        ours.colour = paper.colour = k + 1;
        ours.style = Series::kLinePoints, paper.style = Series::kDashed;
        for (size_t a = 0; a < 5; ++a) {
            const Measures m = measured(
                store, filter_cells(setup, paper_filter(kPropagation[w], kPropagation[a], 40)));
            ours.x.push_back(2 * static_cast<double>(a) - 2);
            paper.x.push_back(ours.x.back());
            ours.y.push_back(m.any() ? 100 * m.position_mean : NAN);
            paper.y.push_back(kTable5[w][a].position_mean);
        }
        plot.series.push_back(ours);
        plot.series.push_back(paper);
    }
    page.plots("fig10", draw({plot}));
    return {};
}

// --- Table 6

constexpr int kPrefixes[] = {20, 30, 40, 50, 60};

std::vector<Cell> all_table6(const PaperSetup& setup) {
    std::vector<Cell> all;
    for (const int prefix : kPrefixes) {
        append(all, filter_cells(setup, paper_filter(kRate, kAccel, prefix)));
        append(all, filter_cells(setup, own_filter(prefix)));
    }
    return all;
}

std::vector<std::string> show_table6(const PaperSetup& setup, const CellStore& store, Page& page) {
    const PaperValues paper[] = {{1.21, 1.39, 15.7, 42.2, -47.8},
                                 {.22, .26, 5.7, 6.9, 20.0},
                                 {.10, .15, 3.4, 4.5, 0.6},
                                 {.10, .16, 2.7, 3.7, -4.2},
                                 {.08, .12, 2.1, 2.8, -3.2}};
    Comparison comparison({"initialization images", "filter"}, false);
    for (size_t i = 0; i < std::size(kPrefixes); ++i) {
        const std::string prefix = std::to_string(kPrefixes[i]);
        comparison.add(
            {prefix, "smooth"},
            measured(store, filter_cells(setup, paper_filter(kRate, kAccel, kPrefixes[i]))),
            paper[i]);
        comparison.add({prefix, "imu-driven"},
                       measured(store, filter_cells(setup, own_filter(kPrefixes[i]))), paper[i]);
    }
    page.table(comparison.table());
    return comparison.worse();
}

}  // namespace

std::vector<Exhibit> arm_exhibits() {
    return {
        {"table1", "Table 1: batch estimates, by inertial variances and initial estimate",
         all_table1, show_table1},
        {"fig8", "Fig. 8: translation error by inertial variances", all_table1, show_fig8},
        {"table2", "Table 2: batch estimates of slowed recordings", all_table2, show_table2},
        {"table4", "Table 4: image-only estimates, by errors of intrinsics and projections",
         all_table4, show_table4},
        {"table5", "Table 5: recursive estimates, by propagation variances", all_table5,
         show_table5},
        {"fig10", "Fig. 10: translation error by propagation variances", all_table5, show_fig10},
        {"table6", "Table 6: recursive estimates, by number of initialization images", all_table6,
         show_table6},
        {"table7", "Table 7: recursive estimates of slowed recordings", all_table7, show_table7},
    };
}

}  // namespace vio::app
