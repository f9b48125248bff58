// The paper's tables and figures (Strelow and Singh 2004, sections 7-10), as cells to be run on
// simulated recordings and as parts of a page that sets the paper's values beside ours.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "app/cells.h"
#include "app/page.h"

namespace vio::app {

/// What the simulated recordings are made from, and how many.
struct PaperSetup {
    std::string datasets = "datasets";  ///< folder of the scenarios
    int seeds = 5;                      ///< recordings of each experiment
};

/// A table or figure of the paper.
struct Exhibit {
    std::string name;   ///< "table1"
    std::string title;  ///< of the page's section
    std::function<std::vector<Cell>(const PaperSetup&)> cells;
    /// Adds to the page; returns what of ours is not as good as the paper's, one line each.
    std::function<std::vector<std::string>(const PaperSetup&, const CellStore&, Page&)> show;
};

/// In the paper's order.
const std::vector<Exhibit>& exhibits();

}  // namespace vio::app
