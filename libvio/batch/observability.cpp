#include "libvio/batch/observability.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

#include "libvio/base/angles.h"
#include "libvio/base/median.h"
#include "libvio/batch/scale_noise.h"

namespace vio::batch {
namespace {

constexpr double kScaleSigma = 0.5, kGravitySigma = 10 * kDegree, kRangeSigma = 0.5;
constexpr double kMotionAngle = 10 * kDegree, kMotionShare = 0.5;

std::string with_figure(const char* format, double a, double b = 0) {
    char text[200];
    std::snprintf(text, sizeof text, format, a, b);
    return text;
}

double scale_deviation(const Model& model, const State& state, const NormalEquations& equations) {
    const Eigen::VectorXd c = scale_reading(model, state, equations);
    if (c.size() == 0) return std::numeric_limits<double>::infinity();
    return std::sqrt(equations.covariance(c)(0, 0));
}

struct Count {
    int uncertain = 0, all = 0;
};

// Points whose distance from the first camera that sees them is uncertain, were all poses known.
Count uncertain_ranges(const Model& model, const State& state, const NormalEquations& equations) {
    Count count;
    for (size_t j = 0; j < model.points.size(); ++j) {
        const Point& point = model.points[j];
        const Observation* first = &model.observations[point.first_observation];
        const auto active = std::count_if(first, first + point.observation_count,
                                          [](const Observation& o) { return o.active; });
        if (point.fiducial || active < 2) continue;
        const InertialState& I = state.frames[first->frame_idx].motion;
        const Eigen::Vector3d ray = state.points[j] - Pose{I.R, I.p} * model.T_I_C.p;
        const double information =
            (ray.transpose() * equations.V[j] * ray)(0, 0);  // of the distance, relative
        ++count.all;
        count.uncertain += information < 1 / (kRangeSigma * kRangeSigma);
    }
    return count;
}

// Two parts of image-only motion are one only by the points that both see: three leave several
// solutions, and the fourth must tell them apart. Names the cut with the fewest; empty: none.
std::string loose_joint(const Model& model) {
    constexpr int kJoining = 4;
    std::vector<int> change(model.frames() + 1, 0);  // of the points that join i - 1 and i
    for (const Point& point : model.points) {
        int first = -1, last = -1;
        for (int k = point.first_observation; k < point.first_observation + point.observation_count;
             ++k) {
            if (!model.observations[k].active) continue;
            last = model.observations[k].frame_idx;
            if (first < 0) first = last;
        }
        if (first < 0) continue;
        ++change[first + 1];
        --change[last + 1];
    }
    int joining = 0, fewest = kJoining, at = 0;
    for (int i = 1; i < model.frames(); ++i) {
        joining += change[i];
        if (joining >= fewest) continue;
        fewest = joining;
        at = i;
    }
    if (fewest == kJoining) return {};
    return with_figure(
        "the motion from %.2f s after the first image on, seen from before (%.0f points join them)",
        to_seconds(model.times[at] - model.times[0]), fewest);
}

// Of images spread over image-only motion, the first whose pose seen from the first image is hardly
// known; empty: none.
std::string loose_motion(const Model& model, const State& state, const NormalEquations& equations) {
    constexpr int kImages = 8;
    const Layout& layout = equations.layout();
    double extent = 0;
    for (const State::Frame& frame : state.frames)
        extent = std::max(extent, (frame.motion.p - state.frames[0].motion.p).norm());
    for (int k = 1; k <= kImages; ++k) {
        const int i = (model.frames() - 1) * k / kImages;
        if (i == 0) continue;
        Eigen::MatrixXd E = Eigen::MatrixXd::Zero(equations.matrix.size(), 6);
        E.middleRows<6>(layout.index(i, 0)).setIdentity();
        const Matrix6d C = equations.covariance(E);
        const double rotation = std::sqrt(C.topLeftCorner<3, 3>().trace()),
                     position = std::sqrt(C.bottomRightCorner<3, 3>().trace()) / extent;
        if (!(rotation < kMotionAngle) || !(position < kMotionShare))
            return with_figure(
                "the motion up to an image, known to %.0f degrees and %.0f %% of "
                "the path's extent (too few points join its parts)",
                rotation / kDegree, 100 * position);
    }
    return {};
}

}  // namespace

Observability judge(const Model& model, const Objective& objective, const State& state,
                    const NormalEquations& equations) {
    Observability result;
    const Count ranges = uncertain_ranges(model, state, equations);
    if (ranges.uncertain > ranges.all / 2)
        result.undetermined.push_back(
            with_figure("the distances of %.0f of %.0f points (the camera hardly moves sideways)",
                        ranges.uncertain, ranges.all));
    if (model.surveyed()) return result;
    if (!model.inertial) {
        std::string loose = loose_joint(model);
        if (loose.empty()) loose = loose_motion(model, state, equations);
        if (!loose.empty()) result.undetermined.push_back(std::move(loose));
        return result;
    }
    result.scale_sigma = scale_deviation(model, state, equations);
    if (!(result.scale_sigma < kScaleSigma))
        result.undetermined.push_back(
            with_figure("the scale of the path, known to %.0f %% (speed or turning changes too "
                        "little, or too few points are seen)",
                        100 * result.scale_sigma));
    const int k = equations.layout().gravity_index();
    Eigen::MatrixXd E = Eigen::MatrixXd::Zero(equations.matrix.size(), 3);
    E.middleRows<3>(k) = objective.gravity_jacobian(state.gravity).transpose();
    const Eigen::Matrix3d C = equations.covariance(E);
    const double tilt = std::sqrt(C.trace()) / state.gravity.norm();
    if (!(tilt < kGravitySigma))
        result.undetermined.push_back(
            with_figure("the direction of gravity, known to %.0f degrees", tilt / kDegree));
    return result;
}

std::string name_null_space(const Model& model, NormalEquations& equations) {
    constexpr double kDamping = 1e-7;  // of the scaled matrix: above its rounding
    constexpr int kIterations = 4;
    const Layout& layout = equations.layout();
    equations.point_damping = NormalEquations::PointDamping::alike;
    if (!equations.factorize(kDamping)) return "the normal equations are not finite";
    // In unknowns scaled to unit information; started from all of them alike. (What holds the scale
    // of image-only motion is no information: hence the upper limit.)
    Eigen::VectorXd scale(equations.matrix.size());
    for (int k = 0; k < scale.size(); ++k) scale(k) = equations.matrix.diagonal(k);
    const double most = 1e4 * median(std::vector<double>(scale.begin(), scale.end()));
    for (double& s : scale) s = 1 / std::sqrt(std::clamp(s, 1e-6, std::max(1e-6, most)));
    Eigen::MatrixXd y(scale.size(), 1);
    for (int k = 0; k < scale.size(); ++k) y(k) = std::cos(1.0 + 2.4 * k);
    for (int i = 0; i < kIterations; ++i) {
        y = (y.array() / scale.array()).matrix().eval();
        y = (equations.factor().solve(y).array() / scale.array()).matrix().eval();
        y.normalize();
    }
    // Its share by kind of unknown, in radians and metres, and the images that it touches.
    y = y.cwiseProduct(scale).normalized().eval();
    double pose = 0, motion = 0, rest = 0, largest = 0;
    std::vector<double> of_frame(model.frames());
    for (int i = 0; i < model.frames(); ++i) {
        for (int c = 0; c < (model.inertial ? 9 : 6); ++c) {
            const double share = std::pow(y(layout.index(i, c)), 2);
            (c < 6 ? pose : motion) += share;
            of_frame[i] += share;
        }
        largest = std::max(largest, of_frame[i]);
    }
    rest = std::max(0.0, 1 - pose - motion);
    if (rest > 0.5) return "the biases, gravity or the points seen longest";
    int first = -1, last = -1, touched = 0;
    for (int i = 0; i < model.frames(); ++i)
        if (of_frame[i] > 0.01 * largest) {
            if (first < 0) first = i;
            last = i;
            ++touched;
        }
    const double begin = to_seconds(model.times[first] - model.times[0]),
                 end = to_seconds(model.times[last] - model.times[0]);
    if (touched > model.frames() / 2)
        return "the motion as a whole (too few points join its parts)";
    return with_figure(
        "the motion from %.2f s to %.2f s after the first image (too few points are "
        "seen there)",
        begin, end);
}

}  // namespace vio::batch
