// One self-contained HTML page on one result.
#pragma once

#include <string>

#include "app/comparison.h"

namespace vio::app {

/// Writes the page to `output` (report.html in the results folder if empty) and returns its name.
/// Throws InputError as read_results() and evaluate() do, and where gnuplot is missing.
std::string write_report(const std::string& folder, const ComparisonOptions& comparison,
                         const std::string& output = "");

}  // namespace vio::app
