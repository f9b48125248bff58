#include "app/measures.h"

#include <cmath>
#include <cstdio>

#include "libvio/base/angles.h"

namespace vio::app {

Measures measure(const std::vector<Outcome>& outcomes, size_t idx) {
    Measures m;
    double scale = 0, scale_size = 0;
    int with_scale = 0;
    for (const Outcome& outcome : outcomes) {
        ++m.runs;
        if (!outcome.ok || outcome.evaluations.size() <= idx) {
            ++m.failed;
            if (m.message.empty()) m.message = outcome.message;
            continue;
        }
        const nlohmann::json& e = outcome.evaluations[idx];
        if (e["rotation_deg"].is_object()) {
            m.rotation_mean += e["rotation_deg"]["mean"].get<double>() * kDegree;
            m.rotation_max += e["rotation_deg"]["max"].get<double>() * kDegree;
        }
        m.position_mean += e["position_m"]["mean"].get<double>();
        m.position_rmse += e["position_m"]["rmse"].get<double>();
        m.position_max += e["position_m"]["max"].get<double>();
        m.path += e["truth_path_length_m"].get<double>();
        if (e["scale_error"].is_number()) {
            scale += e["scale_error"].get<double>();
            scale_size += std::abs(e["scale_error"].get<double>());
            ++with_scale;
        }
        if (e.contains("completion")) m.completion += e["completion"]["share"].get<double>();
        m.iterations += outcome.summary.value("iterations", 0);
        m.seconds +=
            outcome.summary.value("tracking_s", 0.0) + outcome.summary.value("estimation_s", 0.0);
    }
    const double n = m.runs - m.failed;
    if (n == 0) return m;
    for (double* sum : {&m.rotation_mean, &m.rotation_max, &m.position_mean, &m.position_rmse,
                        &m.position_max, &m.iterations, &m.completion, &m.seconds, &m.path})
        *sum /= n;
    if (with_scale > 0) {
        m.scale = scale / with_scale;
        m.scale_size = scale_size / with_scale;
    }
    return m;
}

std::string fixed(double value, int digits) {
    char text[48];
    std::snprintf(text, sizeof(text), "%.*f", digits, value);
    return text;
}

}  // namespace vio::app
