// What an experiment consists of, in numbers, beside those of the experiment that it imitates.
#pragma once

#include <string>
#include <vector>

#include "libvio/base/options.h"

namespace vio {

class Simulation;

/// Extent of an experiment. As the paper's statistics: zero where the paper does not say.
struct ExperimentStatistics {
    double images = 0;
    double imu_readings = 0;
    double duration_s = 0;        ///< from the first to the last image
    double path_m = 0;            ///< distance that the body travels between them
    double turn_deg = 0;          ///< integral of the angular velocity about the optical axis
    double points = 0;            ///< features in all
    double points_per_image = 0;  ///< mean
    double images_per_point = 0;  ///< mean

    void describe(OptionSet& options);
};

/// Statistics of a simulated experiment; those of points are zero if it makes no tracks.
ExperimentStatistics statistics_of(const Simulation& simulation);

/// Where open-loop integration of the noise-free readings from the first image's true state ends,
/// away from the true pose at the last image.
struct ClosingError {
    double position_m = 0, rotation_rad = 0;
};
ClosingError closing_error(const Simulation& simulation);

/// One line of the comparison.
struct ComparedStatistic {
    std::string name, unit;
    double paper = 0;  ///< zero: not stated
    double simulated = 0;
    int decimals = 0;  ///< that are worth printing

    /// simulated / paper - 1 [-]; zero if the paper does not say.
    double deviation() const { return paper > 0 ? simulated / paper - 1 : 0; }
};
std::vector<ComparedStatistic> compared(const ExperimentStatistics& paper,
                                        const ExperimentStatistics& simulated);

/// Markdown table of the scenario's statistics beside the paper's, closing error included.
std::string statistics_table(const Simulation& simulation);

}  // namespace vio
