// Judges feature tracks by true camera poses, and by the true scene where the
// images were rendered.
#pragma once

#include <algorithm>
#include <functional>
#include <map>
#include <opencv2/core/optim.hpp>
#include <optional>
#include <string>
#include <vector>

#include "libvio/base/median.h"
#include "libvio/evaluation/association.h"
#include "libvio/geometry/alignment.h"
#include "libvio/geometry/so3.h"
#include "libvio/io/recording.h"
#include "libvio/io/trajectory_io.h"
#include "libvio/simulation/scenario.h"
#include "libvio/tracking/tracker.h"
#include "libvio/tracking/two_view.h"

namespace track_judgement {

using Eigen::Vector2d;
using Eigen::Vector3d;
using vio::FeatureFrame;
using vio::FeatureId;
using vio::Message;
using vio::Pose;
using vio::TimeNs;

constexpr double kGood_px = 2, kGross_px = 5;
// What is this near the image's edge or behind something else is not expected
// to be seen.
constexpr double kBorder_px = 8;
constexpr double kOcclusion_m = 0.02;

using Poses = std::map<TimeNs, Pose>;

struct Input {
    vio::Rig rig;
    std::vector<Message> messages;
    std::vector<vio::TimedPose> images;  // of which only the time is set
    std::vector<vio::TimedPose> truth;   // T_W_B
    Poses T_W_C;                         // at each image with truth
    Poses T_W_C_fitted;                  // with the truth's mounting and clock fitted
};

// What the truth's instrument and the camera may disagree in: the rotation from
// the camera's frame to the one that the truth calls so, and the difference of
// the clocks.
struct Mounting {
    Vector3d rotation = Vector3d::Zero();  // [rad]
    double time_offset = 0;                // [s]
};

inline Poses camera_poses(const Input& input, const Mounting& mounting) {
    constexpr TimeNs kMaxGap = 100'000'000;
    Poses poses;
    for (const auto& pair : vio::associate(input.images, input.truth, kMaxGap,
                                           vio::from_seconds(mounting.time_offset))) {
        Pose T_W_C = pair.truth * input.rig.T_B_C;
        T_W_C.R = T_W_C.R * vio::so3::exp(mounting.rotation);
        poses[input.images[static_cast<std::size_t>(pair.estimate_idx)].t] = T_W_C;
    }
    return poses;
}

inline Input read_input(const std::string& rawlog, const std::string& truth_file) {
    vio::Recording recording(rawlog);
    Input input{recording.rig(), {}, {}, vio::read_trajectory(truth_file), {}, {}};
    while (auto message = recording.next()) {
        if (const auto* image = std::get_if<vio::ImageMessage>(&*message))
            input.images.push_back({image->t, {}});
        input.messages.push_back(std::move(*message));
    }
    input.T_W_C = camera_poses(input, {});
    return input;
}

struct Run {
    std::vector<FeatureFrame> frames;
    double seconds = 0;
    vio::TrackerReport lost;                        // sums over the images
    std::vector<vio::TrackerReport> reports;        // of each image
    std::vector<std::vector<FeatureId>> by_caller;  // ended after each image
};

struct Sight {
    int frame_idx = 0;
    Vector2d uv;
};

inline std::map<FeatureId, std::vector<Sight>> by_track(const std::vector<FeatureFrame>& frames) {
    std::map<FeatureId, std::vector<Sight>> tracks;
    for (int i = 0; i < static_cast<int>(frames.size()); ++i)
        for (const auto& f : frames[i].features) tracks[f.feature_id].push_back({i, f.uv_px});
    return tracks;
}

inline double share(const std::vector<double>& values, const std::function<bool(double)>& is) {
    if (values.empty()) return 0;
    return static_cast<double>(std::count_if(values.begin(), values.end(), is)) /
           static_cast<double>(values.size());
}

struct EpipolarError {
    double px;
    double px_per_m;    // its standard deviation for positions with one of a metre
    TimeNs first, now;  // the two sights
    double seconds() const { return vio::to_seconds(now - first); }
};

// Of every observation against the first of its track.
inline std::vector<EpipolarError> epipolar_errors(const vio::Camera& camera, const Poses& T_W_C,
                                                  const Run& run) {
    std::vector<EpipolarError> errors;
    for (const auto& [id, sights] : by_track(run.frames)) {
        const TimeNs t1 = run.frames[sights[0].frame_idx].t;
        const auto first = T_W_C.find(t1);
        const auto f1 = camera.ray(sights[0].uv);
        if (first == T_W_C.end() || !f1) continue;
        for (std::size_t k = 1; k < sights.size(); ++k) {
            const auto now = T_W_C.find(run.frames[sights[k].frame_idx].t);
            const auto f2 = camera.ray(sights[k].uv);
            if (now == T_W_C.end() || !f2) continue;
            const Pose T_C1_C2 = first->second.inverse() * now->second;
            const Vector3d t = T_C1_C2.p.norm() > 1e-9 ? T_C1_C2.p.normalized() : Vector3d::UnitZ();
            const double residual =
                vio::two_view_residual({f1->direction, f2->direction}, T_C1_C2.R, t);
            // The baseline turns by its error across it, and the plane of the two rays with it.
            const Vector3d g = T_C1_C2.R * f2->direction, normal = g.cross(f1->direction);
            const double gradient = std::hypot(t.cross(g).norm(), t.cross(f1->direction).norm());
            const double slope =
                M_SQRT2 * normal.cross(t).norm() / std::max(1e-12, gradient * T_C1_C2.p.norm());
            errors.push_back({residual / camera.angular_resolution(),
                              slope / camera.angular_resolution(), t1, now->first});
        }
    }
    return errors;
}

// Share under the limit of a good one, of those that count. Positions with this standard deviation
// [m], known to three of them, may be to blame for more.
template <typename Counts>
double good_share(const std::vector<EpipolarError>& errors, const Counts& counts,
                  double sigma_m = 0) {
    int all = 0, good = 0;
    for (const EpipolarError& e : errors) {
        if (!counts(e)) continue;
        ++all;
        good += e.px < kGood_px + 3 * sigma_m * e.px_per_m;
    }
    return all > 0 ? static_cast<double>(good) / all : 0;
}

// Where the truth itself cannot be right: between two of its poses its position steps aside by more
// than the accelerometer allows (a truth that is fitted to a tracker's sights now and then does).
struct Jump {
    TimeNs t;
    double metres;
};

inline std::vector<Jump> truth_jumps(const Input& input, double least_metres = 1e-3) {
    std::vector<const vio::ImuReading*> readings;
    for (const Message& message : input.messages)
        if (const auto* reading = std::get_if<vio::ImuReading>(&message))
            readings.push_back(reading);
    // Change of velocity at a pose that no reading shows, times the time to the next pose.
    const auto unexplained = [&](std::size_t i) -> Vector3d {
        const auto& [t, T_W_B] = input.truth[i];
        const auto p = [&](std::size_t k) { return (input.truth[k].T_W_B * input.rig.T_B_I).p; };
        const auto near = std::lower_bound(
            readings.begin(), readings.end(), t,
            [](const vio::ImuReading* reading, TimeNs time) { return reading->t < time; });
        const double before = vio::to_seconds(t - input.truth[i - 1].t);
        const double after = vio::to_seconds(input.truth[i + 1].t - t);
        if (near == readings.end() || before > 0.02 || after > 0.02) return Vector3d::Zero();
        const Vector3d a = T_W_B.R * input.rig.T_B_I.R * (*near)->accel - 9.81 * Vector3d::UnitZ();
        const Vector3d change = (p(i + 1) - p(i)) / after - (p(i) - p(i - 1)) / before;
        return after * (change - 0.5 * (before + after) * a);
    };
    // A step shows as a change of velocity and one back, and half of it before and after.
    std::vector<double> steps(input.truth.size(), 0);
    for (std::size_t i = 1; i + 2 < input.truth.size(); ++i)
        steps[i] = 0.5 * (unexplained(i) - unexplained(i + 1)).norm();
    std::vector<Jump> jumps;
    for (std::size_t i = 1; i + 2 < input.truth.size(); ++i)
        if (steps[i] > std::max({least_metres, steps[i - 1], steps[i + 1]}))
            jumps.push_back({input.truth[i].t, steps[i]});
    return jumps;
}

// Camera poses with the rotations of one set and the positions of another,
// brought to its world.
inline Poses mixed(const Poses& of_rotations, const Poses& of_positions) {
    std::vector<Pose> R, p;
    for (const auto& [t, T] : of_rotations)
        if (const auto other = of_positions.find(t); other != of_positions.end()) {
            R.push_back(T);
            p.push_back(other->second);
        }
    Eigen::Matrix3Xd from(3, p.size()), to(3, p.size());
    for (std::size_t i = 0; i < p.size(); ++i) {
        from.col(static_cast<Eigen::Index>(i)) = p[i].p;
        to.col(static_cast<Eigen::Index>(i)) = R[i].p;
    }
    const vio::Similarity S = vio::align(from, to, vio::AlignmentKind::kSE3).S_G_E;
    Poses result;
    for (const auto& [t, T] : of_rotations)
        if (const auto other = of_positions.find(t); other != of_positions.end())
            result[t] = {T.R, S * other->second.p};
    return result;
}

// The mounting with which the tracks agree best: four numbers from all of them,
// by a direct search for the least sum of epipolar errors, each counted up to
// the limit of a good one.
inline Mounting fit_mounting(const Input& input, const Run& run) {
    class Cost final : public cv::MinProblemSolver::Function {
     public:
        Cost(const Input& i, const Run& r)
            : input_(i),
              run_(r),
              most_(epipolar_errors(*i.rig.camera, camera_poses(i, {}), r).size()) {}
        static Mounting mounting(const double* x) { return {1e-2 * Vector3d(x), 1e-2 * x[3]}; }
        int getDims() const override { return 4; }
        double calc(const double* x) const override {
            const std::vector<EpipolarError> errors =
                epipolar_errors(*input_.rig.camera, camera_poses(input_, mounting(x)), run_);
            double sum = 0;
            for (const EpipolarError& e : errors) sum += std::min(e.px, kGood_px);
            // Times without truth must not pay.
            sum += kGood_px * static_cast<double>(most_ - std::min(most_, errors.size()));
            return sum;
        }

     private:
        const Input& input_;
        const Run& run_;
        std::size_t most_;  // errors that there can be
    };
    cv::Mat x = cv::Mat::zeros(1, 4, CV_64F);
    const auto solver = cv::DownhillSolver::create(
        cv::makePtr<Cost>(input, run), cv::Mat(cv::Matx<double, 1, 4>::ones()),
        cv::TermCriteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 150, 1e-3));
    solver->minimize(x);
    return Cost::mounting(x.ptr<double>());
}

// Where the scene's point p_W is in the image; nothing where it cannot be seen.
inline std::optional<Vector2d> visible_at(const vio::Scene& scene, const vio::Camera& camera,
                                          const Pose& T_W_C, const Vector3d& p_W) {
    const auto uv = camera.project(T_W_C.inverse() * p_W);
    if (!uv || !camera.inside_image(*uv, kBorder_px)) return std::nullopt;
    const Vector3d way = p_W - T_W_C.p;
    const auto hit = scene.cast(T_W_C.p, way.normalized());
    if (hit && hit->distance < way.norm() - kOcclusion_m) return std::nullopt;
    return uv;
}

// One track against the point that its first observation shows.
struct JudgedTrack {
    FeatureId id = -1;
    int begin = 0, end = 0;  // images; end: the one after the last that shows it
    int visible = 0;         // images in a row from the first, in which the point can be seen
    std::vector<double> px;  // error of every observation but the first
};

// The points on the ray of a track's first observation that its patch may show:
// where the ray meets the surfaces that are seen within the patch, each
// continued as a plane (an edge in the patch belongs to the nearer surface, its
// centre may lie on the other).
inline std::vector<Vector3d> shown_points(const vio::Scene& scene, const vio::Camera& camera,
                                          const Pose& T_W_C, const Vector2d& uv) {
    constexpr double kReach_px = 4;
    std::vector<Vector3d> points;
    const auto centre = camera.ray(uv);
    if (!centre) return points;
    const Vector3d origin = T_W_C * centre->origin, direction = T_W_C.R * centre->direction;
    for (const double dx : {0., -1., 1.})
        for (const double dy : {0., -1., 1.}) {
            const auto ray = camera.ray(uv + kReach_px * Vector2d(dx, dy));
            if (!ray) continue;
            const Vector3d o = T_W_C * ray->origin, d = T_W_C.R * ray->direction;
            const auto hit = scene.cast(o, d);
            if (!hit) continue;
            const vio::Solid& solid = scene.solids()[static_cast<std::size_t>(hit->solid_idx)];
            const Vector3d normal = solid.T_W_S.R.col(hit->axis), p = o + hit->distance * d;
            const double slope = normal.dot(direction);
            const double distance = solid.shape == vio::Solid::Shape::kBox && std::abs(slope) > 0.05
                                        ? normal.dot(p - origin) / slope
                                        : hit->distance;
            points.push_back(origin + distance * direction);
        }
    return points;
}

// Of all tracks whose first observation shows a point.
inline std::vector<JudgedTrack> judged_tracks(const Input& input, const vio::Simulation& simulation,
                                              const Run& run) {
    std::vector<JudgedTrack> result;
    const vio::Camera& camera = *input.rig.camera;
    const vio::Scene& scene = simulation.scene();
    const auto pose = [&](int i) { return input.T_W_C.at(run.frames[i].t); };
    const int end = static_cast<int>(run.frames.size());
    for (const auto& [id, sights] : by_track(run.frames)) {
        JudgedTrack track{id, sights.front().frame_idx, sights.back().frame_idx + 1, 1, {}};
        // The surface that fits the track best.
        Vector3d p_W = Vector3d::Zero();
        for (const Vector3d& p : shown_points(scene, camera, pose(track.begin), sights[0].uv)) {
            std::vector<double> px;
            for (std::size_t k = 1; k < sights.size(); ++k) {
                const auto uv = camera.project(pose(sights[k].frame_idx).inverse() * p);
                px.push_back(uv ? (*uv - sights[k].uv).norm() : 1e3);
            }
            if (p_W.isZero() || vio::median(px) < vio::median(track.px)) {
                p_W = p;
                track.px = std::move(px);
            }
        }
        if (p_W.isZero()) continue;  // sky
        while (track.begin + track.visible < end &&
               visible_at(scene, camera, pose(track.begin + track.visible), p_W))
            ++track.visible;
        result.push_back(std::move(track));
    }
    return result;
}

}  // namespace track_judgement
