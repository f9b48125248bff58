#include "app/report_innovations.h"

#include <cmath>
#include <utility>

#include "app/measures.h"
#include "libvio/base/chi_square.h"
#include "libvio/base/median.h"

namespace vio::app {
namespace {

// Of the points that were not rejected, and of the inertial readings.
struct Sums {
    int images = 0, inside = 0, dof = 0, readings_dof = 0;
    int points = 0, rejected = 0;
    double normalised = 0, readings_normalised = 0;
    std::vector<double> rms_px;
};

// Central 95 % of what normalised / dof is to be, if the covariance is right.
std::pair<double, double> expected_range(int dof) {
    return {chi_square_quantile(dof, 0.025) / dof, chi_square_quantile(dof, 0.975) / dof};
}

Sums sums(const Estimate& estimate) {
    Sums s;
    for (const ImageInnovations& i : estimate.innovations) {
        s.points += i.landmarks + i.new_points;
        s.rejected += i.landmarks_rejected + i.new_points_rejected;
        s.readings_normalised += i.readings_normalised;
        s.readings_dof += i.readings_dof;
        if (i.dof == 0) continue;
        ++s.images;
        s.dof += i.dof;
        s.normalised += i.normalised;
        const auto [low, high] = expected_range(i.dof);
        s.inside += i.normalised >= low * i.dof && i.normalised <= high * i.dof;
        s.rms_px.push_back(i.rms_px);
    }
    return s;
}

Plot over_time(const std::string& label) {
    Plot plot;
    plot.x_label = "time [s]", plot.y_label = label;
    plot.height = 260;
    return plot;
}

// r^T S^-1 r per degree of freedom, between the bounds that hold 95 % of them.
Plot normalised_plot(const Estimate& estimate, const std::string& label,
                     double ImageInnovations::*normalised, int ImageInnovations::*dof) {
    Plot plot = over_time(label);
    Series value, expected;
    value.name = "normalised";
    expected.name = "95 % if the covariance is right";
    expected.style = Series::kBand;
    expected.colour = 3;
    for (const ImageInnovations& i : estimate.innovations) {
        if (i.*dof == 0) continue;
        const auto [low, high] = expected_range(i.*dof);
        for (Series* s : {&value, &expected})
            s->x.push_back(to_seconds(i.t - estimate.states.front().t));
        value.y.push_back(i.*normalised / (i.*dof));
        expected.y.push_back(low);
        expected.y2.push_back(high);
    }
    plot.series = {expected, value};
    return plot;
}

}  // namespace

std::vector<Plot> innovation_plots(const Estimate& estimate) {
    if (estimate.innovations.empty()) return {};
    Plot rms = over_time("innovation RMS [px]");
    Series value;
    for (const ImageInnovations& i : estimate.innovations) {
        if (i.dof == 0) continue;
        value.x.push_back(to_seconds(i.t - estimate.states.front().t));
        value.y.push_back(i.rms_px);
    }
    rms.series = {value};
    std::vector<Plot> plots = {
        normalised_plot(estimate, "normalised innovation", &ImageInnovations::normalised,
                        &ImageInnovations::dof),
        rms};
    if (sums(estimate).readings_dof > 0)
        plots.push_back(normalised_plot(estimate, "normalised, inertial readings",
                                        &ImageInnovations::readings_normalised,
                                        &ImageInnovations::readings_dof));
    return plots;
}

Table innovation_table(const Estimate& estimate) {
    Table table;
    const Sums s = sums(estimate);
    if (estimate.innovations.empty() || s.images == 0) return table;
    table.header = {"innovations", ""};
    const auto add = [&](const char* name, const std::string& value) {
        table.rows.push_back({name, value});
    };
    add("images with an update", std::to_string(s.images));
    add("RMS of an image, median [px]", fixed(median(s.rms_px), 3));
    add("normalised, mean per degree of freedom (expected 1)", fixed(s.normalised / s.dof, 3));
    add("images inside their 95 % [%]", fixed(100.0 * s.inside / s.images, 1));
    add("points refused by the gate [%]",
        s.points > 0 ? fixed(100.0 * s.rejected / s.points, 2) : "-");
    if (s.readings_dof > 0)
        add("inertial readings, normalised (expected 1)",
            fixed(s.readings_normalised / s.readings_dof, 3));
    return table;
}

Series refused_points(const Estimate& estimate) {
    Series refused;
    refused.name = "refused by the gate";
    refused.colour = 2;
    for (const ImageInnovations& i : estimate.innovations) {
        refused.x.push_back(to_seconds(i.t - estimate.states.front().t));
        refused.y.push_back(i.landmarks_rejected + i.new_points_rejected);
    }
    return refused;
}

std::string innovation_warning(const Estimate& estimate) {
    // Smaller factors are usual; and innovations that are too small do not tell of stated noise
    // that is too large: a feature that creeps errs alike in all images, which innovations do not
    // show.
    constexpr double kLarge = 2, kRefused = 0.1;
    const Sums s = sums(estimate);
    if (s.dof == 0) return "";
    const double ratio = s.normalised / s.dof;
    if (ratio > kLarge)
        return "innovations are " + fixed(ratio, 1) +
               " times what the covariance expects: it is too small (iekf.sigma_px, IMU noise)";
    if (s.rejected > kRefused * s.points)
        return fixed(100.0 * s.rejected / s.points, 0) +
               " % of the points are refused by the gate: wrong tracks, or a wrong calibration";
    return "";
}

}  // namespace vio::app
