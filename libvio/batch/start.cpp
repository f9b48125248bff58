#include "libvio/batch/start.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <utility>

#include "libvio/base/median.h"
#include "libvio/geometry/alignment.h"
#include "libvio/geometry/so3.h"
#include "libvio/geometry/triangulation.h"

namespace vio::batch {
namespace {

constexpr double kSmallestParallax = 0.01;  // [rad]: below it the range is mostly noise

Pose camera_pose(const Model& model, const State& state, int frame) {
    const InertialState& I = state.frames[frame].motion;
    return Pose{I.R, I.p} * model.T_I_C;
}

// Point at a distance along the sight line of its first observation that has one.
Eigen::Vector3d backprojected(const Model& model, const State& state, const Point& point,
                              double distance) {
    for (int k = 0; k < point.observation_count; ++k) {
        const Observation& observation = model.observations[point.first_observation + k];
        const auto ray = model.camera->ray(observation.uv_px);
        if (!ray) continue;
        return camera_pose(model, state, observation.frame_idx) *
               (ray->origin + distance * ray->direction);
    }
    return camera_pose(model, state, 0) * Eigen::Vector3d(0, 0, distance);
}

void backproject_all(const Model& model, double distance, State& state) {
    state.points.resize(model.points.size());
    for (size_t j = 0; j < model.points.size(); ++j)
        state.points[j] = backprojected(model, state, model.points[j], distance);
}

// Distance of a point from the first camera that sees it.
double range_of(const Model& model, const State& state, size_t j) {
    const int first = model.observations[model.points[j].first_observation].frame_idx;
    return (state.points[j] - camera_pose(model, state, first).p).norm();
}

double median_range(const Model& model, const State& state, const std::vector<bool>& placed,
                    double fallback) {
    std::vector<double> ranges;
    for (size_t j = 0; j < model.points.size(); ++j)
        if (placed[j]) ranges.push_back(range_of(model, state, j));
    return ranges.empty() ? fallback : median(std::move(ranges));
}

}  // namespace

State blind_start(const Model& model, const BatchOptions& options) {
    State state;
    state.frames.resize(model.frames());
    backproject_all(model, options.blind_distance, state);
    return state;
}

State turning_start(const Model& model, const BatchOptions& options) {
    State state;
    state.frames.resize(model.frames());
    for (int i = 1; i < model.frames(); ++i) {
        const PreintegratedImu readings(model.segments[i - 1], {}, model.noise);
        state.frames[i].motion.R =
            so3::normalized(state.frames[i - 1].motion.R * readings.delta().R);
    }
    backproject_all(model, options.blind_distance, state);
    return state;
}

std::optional<Eigen::Vector3d> triangulate_point(const Model& model, const State& state,
                                                 const Point& point) {
    std::vector<SightLine> lines;
    for (int k = 0; k < point.observation_count; ++k) {
        const Observation& observation = model.observations[point.first_observation + k];
        if (!observation.active) continue;
        const auto ray = model.camera->ray(observation.uv_px);
        if (!ray) continue;
        const Pose T_W_C = camera_pose(model, state, observation.frame_idx);
        lines.push_back({T_W_C * ray->origin, T_W_C.R * ray->direction});
    }
    const auto result = triangulate(lines, model.camera->angular_resolution());
    if (!result || result->parallax < kSmallestParallax) return std::nullopt;
    return result->point;
}

std::vector<int> points_at_infinity(const Model& model, const State& state) {
    constexpr double kFar = 30;  // times the distance in the middle
    const double far =
        kFar * median_range(model, state, std::vector<bool>(model.points.size(), true), 0);
    std::vector<int> result;
    for (size_t j = 0; j < model.points.size(); ++j)
        if (!model.points[j].fiducial && model.points[j].observation_count > 2 &&
            range_of(model, state, j) > far)
            result.push_back(static_cast<int>(j));
    return result;
}

std::vector<int> points_at_cameras(const Model& model, const State& state) {
    constexpr double kNear = 1e-3;
    std::vector<int> result;
    for (size_t j = 0; j < model.points.size(); ++j) {
        if (model.points[j].fiducial) continue;
        double nearest = std::numeric_limits<double>::infinity(), farthest = 0;
        const Observation* first = &model.observations[model.points[j].first_observation];
        for (const Observation* o = first; o != first + model.points[j].observation_count; ++o) {
            if (!o->active) continue;
            const Eigen::Vector3d centre = camera_pose(model, state, o->frame_idx).p;
            const double range = (state.points[j] - centre).norm();
            nearest = std::min(nearest, range);
            farthest = std::max(farthest, range);
        }
        if (nearest < kNear * farthest) result.push_back(static_cast<int>(j));
    }
    return result;
}

// Images are linear in the inverse distance, each by how far its camera stands beside the sight
// line.
std::vector<int> points_near_by_noise(const Model& model, const State& state) {
    constexpr double kNear = 2;    // times the inverse distance in the middle
    constexpr double kSigmas = 5;  // that noise may make of it
    struct Sighted {
        int point_idx;
        double inverse, sigma;
    };
    std::vector<Sighted> all;
    std::vector<double> inverses;
    for (size_t j = 0; j < model.points.size(); ++j) {
        const Point& point = model.points[j];
        if (point.fiducial) continue;
        std::vector<std::pair<Eigen::Vector3d, double>> centres;  // and weights [1/rad^2]
        Eigen::Vector3d sum = Eigen::Vector3d::Zero();
        double weights = 0;
        for (int k = 0; k < point.observation_count; ++k) {
            const Observation& o = model.observations[point.first_observation + k];
            if (!o.active) continue;
            const double angle = model.camera->angular_resolution();
            centres.emplace_back(camera_pose(model, state, o.frame_idx).p,
                                 o.sqrt_information.determinant() / (angle * angle));
            sum += centres.back().second * centres.back().first;
            weights += centres.back().second;
        }
        if (centres.size() < 2) continue;
        const Eigen::Vector3d middle = sum / weights, line = state.points[j] - middle;
        const double distance = line.norm();
        double information = 0;
        for (const auto& [centre, weight] : centres)
            information += weight * (centre - middle).cross(line).squaredNorm();
        if (!(distance > 0)) continue;
        inverses.push_back(1 / distance);
        all.push_back({static_cast<int>(j), 1 / distance, distance / std::sqrt(information)});
    }
    std::vector<int> result;
    if (all.empty()) return result;
    const double usual = median(std::move(inverses));
    for (const Sighted& s : all)
        if (s.inverse > kNear * usual && s.inverse - usual < kSigmas * s.sigma)
            result.push_back(s.point_idx);
    return result;
}

void place_other_points(const Model& model, std::vector<bool> placed, State& state) {
    constexpr double kWithoutAny = 1;  // [m]: nothing tells a distance
    for (size_t j = 0; j < model.points.size(); ++j) {
        if (placed[j]) continue;
        const auto point = triangulate_point(model, state, model.points[j]);
        if (!point) continue;
        state.points[j] = *point;
        placed[j] = true;
    }
    const double range = median_range(model, state, placed, kWithoutAny);
    for (size_t j = 0; j < model.points.size(); ++j)
        if (!placed[j]) state.points[j] = backprojected(model, state, model.points[j], range);
}

namespace {

// Points whose positions are known already, and all others around them.
void place_around(const Model& model, const std::map<FeatureId, Eigen::Vector3d>& positions,
                  State& state) {
    state.points.assign(model.points.size(), Eigen::Vector3d::Zero());
    std::vector<bool> placed(model.points.size(), false);
    for (size_t j = 0; j < model.points.size(); ++j)
        if (const auto known = positions.find(model.points[j].id); known != positions.end()) {
            state.points[j] = known->second;
            placed[j] = true;
        }
    place_other_points(model, std::move(placed), state);
}

// The state after a known one, by the readings between them; without any, at constant velocity.
State::Frame next_frame(const Model& model, const State& state, int i) {
    State::Frame next = state.frames[i];
    if (model.inertial) {
        const PreintegratedImu readings(model.segments[i], next.bias, model.noise);
        next.motion = readings.predict(next.motion, next.bias, state.gravity);
    } else if (i > 0) {
        const InertialState &before = state.frames[i - 1].motion, &last = state.frames[i].motion;
        next.motion.R = so3::normalized(last.R * before.R.transpose() * last.R);
        next.motion.p += last.p - before.p;
    }
    return next;
}

// The state before a known one.
State::Frame previous_frame(const Model& model, const State& state, int i) {
    State::Frame previous = state.frames[i];
    if (!model.inertial) return previous;
    const PreintegratedImu readings(model.segments[i - 1], previous.bias, model.noise);
    const double T = readings.duration();
    const InertialState& delta = readings.delta();
    InertialState& m = previous.motion;
    m.R = so3::normalized(m.R * delta.R.transpose());
    m.v -= state.gravity * T + m.R * delta.v;
    m.p -= m.v * T + state.gravity * (T * T / 2) + m.R * delta.p;
    return previous;
}

// A start may stand in another frame than the survey: moves it so that the surveyed points, as its
// poses see them, come to where they are. Those that stay far off are left out the second time.
// Returns the motion; none where these points are too few.
Similarity move_to_survey(const Model& model, State& state) {
    constexpr double kFar = 3;  // times the median
    std::vector<Eigen::Vector3d> seen, given;
    for (const Point& point : model.points)
        if (point.fiducial)
            if (const auto p = triangulate_point(model, state, point)) {
                seen.push_back(*p);
                given.push_back(point.fiducial->p_W);
            }
    Similarity S;
    for (int round = 0; round < 2; ++round) {
        if (seen.size() < 3) return {};
        const auto columns = [](const std::vector<Eigen::Vector3d>& list) -> Eigen::Matrix3Xd {
            return Eigen::Map<const Eigen::Matrix3Xd>(list.front().data(), 3,
                                                      static_cast<Eigen::Index>(list.size()));
        };
        const Alignment alignment = align(columns(seen), columns(given), AlignmentKind::kSE3);
        if (alignment.status != AlignmentStatus::kDetermined) return {};
        S = alignment.S_G_E;
        std::vector<double> off;
        for (size_t k = 0; k < seen.size(); ++k) off.push_back((S * seen[k] - given[k]).norm());
        const double limit = kFar * median(off);
        size_t kept = 0;
        for (size_t k = 0; k < seen.size(); ++k) {
            if (off[k] > limit) continue;
            seen[kept] = seen[k];
            given[kept++] = given[k];
        }
        seen.resize(kept);
        given.resize(kept);
    }
    for (State::Frame& frame : state.frames) {
        InertialState& I = frame.motion;
        I.R = so3::normalized(S.R * I.R);
        I.p = S * I.p;
        I.v = S.R * I.v;
    }
    state.gravity = S.R * state.gravity;
    return S;
}

}  // namespace

State continued_start(const Model& model, const Model& shorter, const State& known) {
    State state = known;
    state.frames.reserve(model.frames());
    while (static_cast<int>(state.frames.size()) < model.frames())
        state.frames.push_back(next_frame(model, state, static_cast<int>(state.frames.size()) - 1));
    std::map<FeatureId, Eigen::Vector3d> positions;
    for (size_t j = 0; j < shorter.points.size(); ++j)
        positions[shorter.points[j].id] = known.points[j];
    place_around(model, positions, state);
    return state;
}

State given_start(const Model& model, const Estimate& start) {
    constexpr TimeNs kTolerance = 1'000'000;
    State state;
    state.gravity = start.g_W;
    state.frames.resize(model.frames());
    const Pose T_B_I = model.T_I_B.inverse();
    std::vector<bool> given(model.frames(), false);
    for (int i = 0; i < model.frames(); ++i) {
        const TimeNs t = model.times[i];
        const auto it =
            std::lower_bound(start.states.begin(), start.states.end(), t - kTolerance,
                             [](const StateEstimate& s, TimeNs time) { return s.t < time; });
        if (it == start.states.end() || it->t > t + kTolerance) continue;
        given[i] = true;
        const Pose T_W_I = it->T_W_B * T_B_I;
        State::Frame& frame = state.frames[i];
        frame.motion = {T_W_I.R, T_W_I.p, it->v_W};
        frame.bias = {it->gyro_bias, it->accel_bias};
        if (model.inertial) {
            const Eigen::Vector3d rate = model.gyro_at_image[i] - it->gyro_bias;
            frame.motion.v -= T_W_I.R * rate.cross(model.T_I_B.p);
        }
    }
    const auto first =
        static_cast<int>(std::find(given.begin(), given.end(), true) - given.begin());
    if (first == model.frames())
        throw InputError("start trajectory: no state at the time of any image (first image: t = " +
                         std::to_string(model.times.front()) + " ns); compare the clocks");
    for (int i = first; i > 0; --i) state.frames[i - 1] = previous_frame(model, state, i);
    for (int i = first + 1; i < model.frames(); ++i)
        if (!given[i]) state.frames[i] = next_frame(model, state, i - 1);
    std::map<FeatureId, Eigen::Vector3d> positions;
    const Similarity S = model.surveyed() ? move_to_survey(model, state) : Similarity{};
    for (const LandmarkEstimate& landmark : start.landmarks)
        positions[landmark.id] = S * landmark.p_W;
    for (const Point& point : model.points)
        if (point.fiducial) positions[point.id] = point.fiducial->p_W;
    place_around(model, positions, state);
    return state;
}

}  // namespace vio::batch
