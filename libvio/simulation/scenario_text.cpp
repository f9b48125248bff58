#include "libvio/simulation/scenario_text.h"

#include <cmath>
#include <sstream>

#include "libvio/base/angles.h"
#include "libvio/base/errors.h"

namespace vio {

std::vector<double> numbers_in(const std::string& text, const std::string& option) {
    std::istringstream in(text);
    std::vector<double> values;
    for (std::string word; in >> word;) {
        char* end = nullptr;
        values.push_back(std::strtod(word.c_str(), &end));
        if (*end != '\0' || !std::isfinite(values.back()))
            throw InputError("scenario " + option + ": '" + word + "' is not a number");
    }
    return values;
}

std::vector<double> numbers_in(const std::string& text, const std::string& option, size_t count) {
    std::vector<double> values = numbers_in(text, option);
    if (values.size() != count)
        throw InputError("scenario " + option + ": " + std::to_string(values.size()) +
                         " numbers in '" + text + "', expected " + std::to_string(count));
    return values;
}

Pose pose_from(const double* v) {
    using Eigen::AngleAxisd, Eigen::Vector3d;
    return {(AngleAxisd(v[3] * kDegree, Vector3d::UnitZ()) *
             AngleAxisd(v[4] * kDegree, Vector3d::UnitY()) *
             AngleAxisd(v[5] * kDegree, Vector3d::UnitX()))
                .toRotationMatrix(),
            {v[0], v[1], v[2]}};
}

Pose pose_option(const std::string& text, const std::string& option) {
    return pose_from(numbers_in(text, option, 6).data());
}

}  // namespace vio
