// How good feature tracks are, with the tracker's parts switched off one by one:
//   vio_track_quality RAWLOG TRUTH.tum [SCENARIO.ini] [--set SECTION.KEY=VALUE]...
// Judged by the true poses (T_W_B at the images): share of the observations whose epipolar error
// against the track's first observation is under 2 px, with the truth as it is and with its
// mounting and clock fitted to the tracks. With the scenario that the rawlog's images were rendered
// from also by the true points: each track's first observation is cast onto the scene, and every
// later one compared with that point's projection. --set changes the tracker's options and the
// scenario's.
#include <algorithm>
#include <cstdio>
#include <functional>
#include <map>
#include <opencv2/core/optim.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <optional>
#include <string>
#include <vector>

#include "libvio/base/median.h"
#include "libvio/evaluation/association.h"
#include "libvio/geometry/so3.h"
#include "libvio/io/trajectory_io.h"
#include "libvio/simulation/scenario.h"
#include "libvio/tracking/front_end.h"
#include "libvio/tracking/two_view.h"

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using vio::FeatureFrame;
using vio::FeatureId;
using vio::Message;
using vio::Pose;
using vio::TimeNs;

constexpr double kGood_px = 2, kGross_px = 5;
// What is this near the image's edge or behind something else is not expected to be seen.
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

// What the truth's instrument and the camera may disagree in: the rotation from the camera's frame
// to the one that the truth calls so, and the difference of the clocks.
struct Mounting {
    Vector3d rotation = Vector3d::Zero();  // [rad]
    double time_offset = 0;                // [s]
};

Poses camera_poses(const Input& input, const Mounting& mounting) {
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

Input read_input(const std::string& rawlog, const std::string& truth_file) {
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

// ---- Trackers ---------------------------------------------------------------------------------

struct Run {
    std::vector<FeatureFrame> frames;
    double seconds = 0;
    vio::TrackerReport lost;  // sums over the images
};

Run run_tracker(const Input& input, const vio::TrackerOptions& options, bool use_gyro) {
    vio::TrackingFrontEnd front_end(options, input.rig, use_gyro);
    Run run;
    const auto take = [&](std::vector<FeatureFrame> frames) {
        for (FeatureFrame& frame : frames) run.frames.push_back(std::move(frame));
    };
    const int64 begin = cv::getTickCount();
    for (const Message& message : input.messages) {
        const std::size_t before = run.frames.size();
        take(front_end.add(message));
        if (run.frames.size() == before) continue;
        const vio::TrackerReport& r = front_end.tracker().report();
        run.lost.lost_flow += r.lost_flow;
        run.lost.lost_look += r.lost_look;
        run.lost.found_again += r.found_again;
        run.lost.lost_geometry += r.lost_geometry;
        run.lost.lost_window += r.lost_window;
    }
    take(front_end.finish());
    run.seconds = static_cast<double>(cv::getTickCount() - begin) / cv::getTickFrequency();
    return run;
}

// OpenCV's corners and its Lucas-Kanade tracker from image to image, with nothing else.
Run run_plain_lk(const Input& input, const vio::TrackerOptions& options) {
    Run run;
    cv::Mat previous;
    std::vector<cv::Point2f> places;
    std::vector<FeatureId> ids;
    FeatureId next_id = 0;
    const int64 begin = cv::getTickCount();
    for (const Message& message : input.messages) {
        const auto* image = std::get_if<vio::ImageMessage>(&message);
        if (!image) continue;
        if (!places.empty()) {
            std::vector<cv::Point2f> to;
            std::vector<unsigned char> found;
            std::vector<float> error;
            cv::calcOpticalFlowPyrLK(previous, image->image, places, to, found, error,
                                     {options.window_px, options.window_px},
                                     options.pyramid_levels);
            std::size_t kept = 0;
            for (std::size_t i = 0; i < to.size(); ++i) {
                if (!found[i] || !input.rig.camera->inside_image({to[i].x, to[i].y})) continue;
                places[kept] = to[i];
                ids[kept++] = ids[i];
            }
            places.resize(kept);
            ids.resize(kept);
        }
        cv::Mat mask(image->image.size(), CV_8U, cv::Scalar(255));
        for (const cv::Point2f& p : places)
            cv::circle(mask, p, static_cast<int>(options.min_distance_px), 0, cv::FILLED);
        const int wanted = options.max_features - static_cast<int>(places.size());
        std::vector<cv::Point2f> corners;
        if (wanted > 0)
            cv::goodFeaturesToTrack(image->image, corners, wanted, options.corner_quality,
                                    options.min_distance_px, mask);
        for (const cv::Point2f& p : corners) {
            places.push_back(p);
            ids.push_back(next_id++);
        }
        FeatureFrame frame{image->t, {}};
        for (std::size_t i = 0; i < places.size(); ++i)
            frame.features.push_back(
                {ids[i], {places[i].x, places[i].y}, Eigen::Matrix2d::Identity()});
        run.frames.push_back(std::move(frame));
        previous = image->image;
    }
    run.seconds = static_cast<double>(cv::getTickCount() - begin) / cv::getTickFrequency();
    return run;
}

// ---- Judgement --------------------------------------------------------------------------------

struct Sight {
    int frame_idx = 0;
    Vector2d uv;
};

std::map<FeatureId, std::vector<Sight>> by_track(const std::vector<FeatureFrame>& frames) {
    std::map<FeatureId, std::vector<Sight>> tracks;
    for (int i = 0; i < static_cast<int>(frames.size()); ++i)
        for (const auto& f : frames[i].features) tracks[f.feature_id].push_back({i, f.uv_px});
    return tracks;
}

double share(const std::vector<double>& values, const std::function<bool(double)>& is) {
    if (values.empty()) return 0;
    return static_cast<double>(std::count_if(values.begin(), values.end(), is)) /
           static_cast<double>(values.size());
}

// Epipolar errors [px] of every observation against the first of its track.
std::vector<double> epipolar_errors(const vio::Camera& camera, const Poses& T_W_C, const Run& run) {
    std::vector<double> errors;
    for (const auto& [id, sights] : by_track(run.frames)) {
        const auto first = T_W_C.find(run.frames[sights[0].frame_idx].t);
        const auto f1 = camera.ray(sights[0].uv);
        if (first == T_W_C.end() || !f1) continue;
        for (std::size_t k = 1; k < sights.size(); ++k) {
            const auto now = T_W_C.find(run.frames[sights[k].frame_idx].t);
            const auto f2 = camera.ray(sights[k].uv);
            if (now == T_W_C.end() || !f2) continue;
            const Pose T_C1_C2 = first->second.inverse() * now->second;
            const Vector3d t = T_C1_C2.p.norm() > 1e-9 ? T_C1_C2.p.normalized() : Vector3d::UnitZ();
            errors.push_back(vio::two_view_residual({f1->direction, f2->direction}, T_C1_C2.R, t) /
                             camera.angular_resolution());
        }
    }
    return errors;
}

// The mounting with which the tracks agree best: four numbers from all of them, by a direct search
// for the least sum of epipolar errors, each counted up to the limit of a good one.
Mounting fit_mounting(const Input& input, const Run& run) {
    class Cost final : public cv::MinProblemSolver::Function {
     public:
        Cost(const Input& i, const Run& r)
            : input_(i),
              run_(r),
              most_(epipolar_errors(*i.rig.camera, camera_poses(i, {}), r).size()) {}
        static Mounting mounting(const double* x) { return {1e-2 * Vector3d(x), 1e-2 * x[3]}; }
        int getDims() const override { return 4; }
        double calc(const double* x) const override {
            const std::vector<double> errors =
                epipolar_errors(*input_.rig.camera, camera_poses(input_, mounting(x)), run_);
            double sum = 0;
            for (const double e : errors) sum += std::min(e, kGood_px);
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
std::optional<Vector2d> visible_at(const vio::Scene& scene, const vio::Camera& camera,
                                   const Pose& T_W_C, const Vector3d& p_W) {
    const auto uv = camera.project(T_W_C.inverse() * p_W);
    if (!uv || !camera.inside_image(*uv, kBorder_px)) return std::nullopt;
    const Vector3d way = p_W - T_W_C.p;
    const auto hit = scene.cast(T_W_C.p, way.normalized());
    if (hit && hit->distance < way.norm() - kOcclusion_m) return std::nullopt;
    return uv;
}

struct PointErrors {
    std::vector<double> px;          // of every observation but each track's first
    std::vector<double> life_share;  // of each track: images seen / images in which it can be seen
    double seen = 0, could = 0;      // sums of these
};

// The points on the ray of a track's first observation that its patch may show: where the ray meets
// the surfaces that are seen within the patch, each continued as a plane (an edge in the patch
// belongs to the nearer surface, its centre may lie on the other).
std::vector<Vector3d> shown_points(const vio::Scene& scene, const vio::Camera& camera,
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

PointErrors point_errors(const Input& input, const vio::Simulation& simulation, const Run& run) {
    PointErrors result;
    const vio::Camera& camera = *input.rig.camera;
    const vio::Scene& scene = simulation.scene();
    const auto pose = [&](int i) { return input.T_W_C.at(run.frames[i].t); };
    const int end = static_cast<int>(run.frames.size());
    for (const auto& [id, sights] : by_track(run.frames)) {
        const int begin = sights[0].frame_idx;
        // The surface that fits the track best.
        std::vector<double> errors;
        Vector3d p_W = Vector3d::Zero();
        for (const Vector3d& p : shown_points(scene, camera, pose(begin), sights[0].uv)) {
            std::vector<double> px;
            for (std::size_t k = 1; k < sights.size(); ++k) {
                const auto uv = camera.project(pose(sights[k].frame_idx).inverse() * p);
                px.push_back(uv ? (*uv - sights[k].uv).norm() : 1e3);
            }
            if (p_W.isZero() || vio::median(px) < vio::median(errors)) {
                p_W = p;
                errors = std::move(px);
            }
        }
        if (p_W.isZero()) continue;  // sky
        result.px.insert(result.px.end(), errors.begin(), errors.end());
        if (begin + 1 == end) continue;
        int visible = 1;
        while (begin + visible < end && visible_at(scene, camera, pose(begin + visible), p_W))
            ++visible;
        const int life = std::min(visible, static_cast<int>(sights.size()));
        if (visible < 2) continue;
        result.life_share.push_back(static_cast<double>(life) / visible);
        result.seen += life;
        result.could += visible;
    }
    return result;
}

void print_header(bool has_scene) {
    std::printf("%-26s %7s %7s %7s %7s %7s %8s", "", "per img", "length", "median", "raw<2px",
                "fit<2px", "ms/img");
    if (has_scene)
        std::printf(" %8s %7s %7s %7s %7s %7s", "err med", "<2px", ">5px", "life", "median",
                    "<1px");
    std::printf(
        "   tracks of 1, 2-4, 5-9, 10-19, 20-39, 40- images | lost: flow, look, again, "
        "geometry, window\n");
}

void print_row(const std::string& name, const Input& input, const vio::Simulation* simulation,
               const Run& run) {
    const auto tracks = by_track(run.frames);
    std::vector<double> lengths;
    double observations = 0;
    int histogram[6] = {};
    for (const auto& [id, sights] : tracks) {
        const auto n = sights.size();
        lengths.push_back(static_cast<double>(n));
        observations += static_cast<double>(n);
        ++histogram[n < 2 ? 0 : n < 5 ? 1 : n < 10 ? 2 : n < 20 ? 3 : n < 40 ? 4 : 5];
    }
    const auto images = static_cast<double>(run.frames.size());
    const auto good_share = [&](const Poses& T_W_C) {
        return 100 * share(epipolar_errors(*input.rig.camera, T_W_C, run),
                           [](double e) { return e < kGood_px; });
    };
    std::printf("%-26s %7.1f %7.1f %7.0f %6.2f%% %6.2f%% %8.2f", name.c_str(),
                observations / images, observations / static_cast<double>(tracks.size()),
                vio::median(lengths), good_share(input.T_W_C), good_share(input.T_W_C_fitted),
                1e3 * run.seconds / images);
    if (simulation) {
        const PointErrors e = point_errors(input, *simulation, run);
        std::printf(" %8.3f %6.2f%% %6.2f%% %6.1f%% %6.1f%% %6.2f%%", vio::median(e.px),
                    100 * share(e.px, [](double px) { return px < kGood_px; }),
                    100 * share(e.px, [](double px) { return px > kGross_px; }),
                    100 * e.seen / e.could, 100 * vio::median(e.life_share),
                    100 * share(e.px, [](double px) { return px < 1; }));
    }
    std::printf("   %d %d %d %d %d %d | %d %d %d %d %d\n", histogram[0], histogram[1], histogram[2],
                histogram[3], histogram[4], histogram[5], run.lost.lost_flow, run.lost.lost_look,
                run.lost.found_again, run.lost.lost_geometry, run.lost.lost_window);
}

int measure(const std::vector<std::string>& files, const std::vector<std::string>& assignments) {
    cv::setNumThreads(1);
    vio::TrackerOptions options;
    vio::OptionSet declared;
    options.describe(declared);
    vio::ScenarioOptions scenario;
    if (files.size() > 2) scenario = vio::ScenarioOptions::from_file(files[2]);
    vio::OptionSet of_scenario;
    scenario.describe(of_scenario);
    for (const std::string& assignment : assignments)
        (assignment.rfind("tracker.", 0) == 0 ? declared : of_scenario).set(assignment);
    Input input = read_input(files[0], files[1]);
    std::optional<vio::Simulation> simulation;
    if (files.size() > 2) simulation.emplace(scenario);
    const vio::Simulation* truth = simulation ? &*simulation : nullptr;

    {
        vio::TrackerOptions plain = options;
        plain.max_features = 50;
        const Mounting mounting = fit_mounting(input, run_tracker(input, plain, true));
        input.T_W_C_fitted = camera_poses(input, mounting);
        const Vector3d r = 180 / M_PI * mounting.rotation;
        std::printf("the truth's mounting: %.3f %.3f %.3f deg, clock: %.2f ms\n", r.x(), r.y(),
                    r.z(), 1e3 * mounting.time_offset);
    }
    print_header(truth != nullptr);
    const auto row = [&](const std::string& name, auto change, bool use_gyro = true) {
        vio::TrackerOptions changed = options;
        change(changed);
        print_row(name, input, truth, run_tracker(input, changed, use_gyro));
    };
    row("all parts", [](auto&) {});
    row(
        "no gyro", [](auto&) {}, false);
    row("no first appearance", [](auto& o) { o.realign = false; });
    row("no window of 30 images", [](auto& o) { o.window_images = 0; });
    row("no geometry", [](auto& o) { o.geometry_px = 100, o.long_gap = o.window_images = 0; });
    print_row("plain Lucas-Kanade", input, truth, run_plain_lk(input, options));
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    std::vector<std::string> files, assignments;
    for (int i = 1; i < argc; ++i) {
        const std::string argument = argv[i];
        if (argument == "--set" && i + 1 < argc)
            assignments.push_back(argv[++i]);
        else
            files.push_back(argument);
    }
    if (files.size() < 2 || files.size() > 3) {
        std::fprintf(stderr,
                     "usage: vio_track_quality RAWLOG TRUTH.tum [SCENARIO.ini] "
                     "[--set SECTION.KEY=VALUE]...\n");
        return 2;
    }
    try {
        return measure(files, assignments);
    } catch (const std::exception& error) {
        std::fprintf(stderr, "vio_track_quality: %s\n", error.what());
        return 1;
    }
}
