// How good feature tracks are, and what each part of the tracker is worth:
//   vio_track_quality RAWLOG TRUTH.tum [SCENARIO.ini] [--set SECTION.KEY=VALUE]...
//                     [--brief] [--ends] [--spoil] [--estimate POSES.tum]
// The tracker runs with the recursive estimator, which predicts and ends
// tracks; then again with its parts switched off one by one (--brief: not), and
// beside it OpenCV's Lucas-Kanade tracker. Judged by the true poses (T_W_B at
// the images): share of the observations whose epipolar error against the
// track's first observation is under 2 px, with the truth as it is and with its
// mounting and clock fitted to the tracks. With the scenario that the rawlog's
// images were rendered from also by the true points: each track's first
// observation is cast onto the scene, and every later one compared with that
// point's projection. --set changes the tracker's options and the scenario's.
// --estimate tells whether rotations or positions of the truth are to blame:
// the share also with the rotations of one and the positions of the other.
// Where a recorded truth jumps is told by the accelerometer; rows allow for
// noise in its positions. --ends: why tracks end. --spoil: the same images
// blurred, dark, missing.
// Measured: what the estimator predicts and ends is worth nothing beside the
// gyro and the geometry, at 1.5 Hz, in sudden moves at 6 Hz and with images
// missing as little as at 30 Hz.
#include <array>
#include <cstdio>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "libvio/base/angles.h"
#include "libvio/recursive/iekf.h"
#include "libvio/tracking/front_end.h"
#include "tests/tools/spoiled_images.h"
#include "tests/tools/track_judgement.h"

namespace {

using namespace track_judgement;

// ---- Trackers ---------------------------------------------------------------------------------

// What the tracker has beside its options.
struct Parts {
    bool gyro = true, prediction = true, feedback = true;
};

bool has_imu(const Input& input) {
    return std::any_of(input.messages.begin(), input.messages.end(),
                       [](const Message& m) { return std::holds_alternative<vio::ImuReading>(m); });
}

Run run_tracker(const Input& input, const vio::TrackerOptions& options, const Parts& parts) {
    vio::TrackingFrontEnd front_end(options, input.rig, parts.gyro && has_imu(input));
    vio::Iekf filter(input.rig, {}, {}, has_imu(input));
    const bool with_filter = parts.prediction || parts.feedback;
    if (parts.prediction) front_end.set_predictor([&](TimeNs t) { return filter.predict(t); });
    Run run;
    const auto take = [&](const std::vector<FeatureFrame>& frames) {
        for (const FeatureFrame& frame : frames) {
            if (with_filter) filter.add(frame);
            run.frames.push_back(frame);
        }
        for (const vio::TrackerReport& r : front_end.reports()) {
            run.lost.lost_flow += r.lost_flow;
            run.lost.lost_look += r.lost_look;
            run.lost.found_again += r.found_again;
            run.lost.lost_geometry += r.lost_geometry;
            run.lost.lost_window += r.lost_window;
            run.lost.ended_by_caller += r.ended_by_caller;
            run.reports.push_back(r);
        }
        run.by_caller.resize(run.frames.size());
    };
    const auto timed = [&](auto work) {
        const int64 begin = cv::getTickCount();
        auto frames = work();
        run.seconds += static_cast<double>(cv::getTickCount() - begin) / cv::getTickFrequency();
        return frames;
    };
    for (const Message& message : input.messages) {
        const auto* reading = std::get_if<vio::ImuReading>(&message);
        if (with_filter && reading) filter.add(*reading);
        take(timed([&] { return front_end.add(message); }));
        if (parts.feedback) {
            const std::vector<FeatureId> rejected = filter.take_rejected();
            front_end.end_tracks(rejected);
            if (!run.by_caller.empty())
                run.by_caller.back().insert(run.by_caller.back().end(), rejected.begin(),
                                            rejected.end());
        }
        if (with_filter) filter.take();
    }
    take(timed([&] { return front_end.finish(); }));
    return run;
}

// OpenCV's corners and its Lucas-Kanade tracker from image to image, with
// nothing else.
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

void print_header(bool has_scene) {
    std::printf("%-26s %7s %7s %7s %7s %7s %8s", "", "per img", "length", "median", "raw<2px",
                "fit<2px", "ms/img");
    if (has_scene)
        std::printf(" %8s %7s %7s %7s %7s %7s", "err med", "<2px", ">5px", "life", "median",
                    "<1px");
    std::printf(
        "   tracks of 1, 2-4, 5-9, 10-19, 20-39, 40- images | lost: flow, look, again, geometry, "
        "window, caller\n");
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
    const auto epipolar = [&](const Poses& T_W_C) {
        return 100 * good_share(epipolar_errors(*input.rig.camera, T_W_C, run),
                                [](const EpipolarError&) { return true; });
    };
    std::printf("%-26s %7.1f %7.1f %7.0f %6.2f%% %6.2f%% %8.2f", name.c_str(),
                observations / images, observations / static_cast<double>(tracks.size()),
                vio::median(lengths), epipolar(input.T_W_C), epipolar(input.T_W_C_fitted),
                1e3 * run.seconds / images);
    if (simulation) {
        std::vector<double> px, life_share;
        double seen = 0, could = 0;
        for (const JudgedTrack& track : judged_tracks(input, *simulation, run)) {
            px.insert(px.end(), track.px.begin(), track.px.end());
            if (track.visible < 2) continue;
            const double life = std::min(track.visible, static_cast<int>(track.px.size()) + 1);
            life_share.push_back(life / track.visible);
            seen += life;
            could += track.visible;
        }
        std::printf(" %8.3f %6.2f%% %6.2f%% %6.1f%% %6.1f%% %6.2f%%", vio::median(px),
                    100 * share(px, [](double e) { return e < kGood_px; }),
                    100 * share(px, [](double e) { return e > kGross_px; }), 100 * seen / could,
                    100 * vio::median(life_share), 100 * share(px, [](double e) { return e < 1; }));
    }
    std::printf("   %d %d %d %d %d %d | %d %d %d %d %d %d\n", histogram[0], histogram[1],
                histogram[2], histogram[3], histogram[4], histogram[5], run.lost.lost_flow,
                run.lost.lost_look, run.lost.found_again, run.lost.lost_geometry,
                run.lost.lost_window, run.lost.ended_by_caller);
}

// Why tracks end while their points can still be seen, by ranges of images, and how wrong they had
// been until then: their greatest error.
void print_ends(const Input& input, const vio::Simulation& simulation, const Run& run) {
    enum Reason { kLeft, kCaller, kWindow, kTwoViews, kNotFound, kReasons };
    constexpr const char* kNames[] = {"out of sight", "estimator", "window", "two views",
                                      "not found"};
    constexpr double kUpTo_px[] = {0.5, 1, 2, 5};
    constexpr int kRange = 100, kBins = 5;
    const int images = static_cast<int>(run.frames.size());
    std::vector<std::array<std::array<int, kBins>, kReasons>> ends((images + kRange - 1) / kRange);
    const auto holds = [](const auto& ids, FeatureId id) {
        return std::find(ids.begin(), ids.end(), id) != ids.end();
    };
    for (const JudgedTrack& track : judged_tracks(input, simulation, run)) {
        if (track.end >= images) continue;
        Reason reason = kNotFound;
        const vio::TrackerReport& r = run.reports[track.end];
        const auto of_window = r.rejected.end() - r.lost_window;
        if (track.end >= track.begin + track.visible)
            reason = kLeft;
        else if (holds(run.by_caller[track.end - 1], track.id))
            reason = kCaller;
        else if (std::find(of_window, r.rejected.end(), track.id) != r.rejected.end())
            reason = kWindow;
        else if (std::find(r.rejected.begin(), of_window, track.id) != of_window)
            reason = kTwoViews;
        const double worst =
            track.px.empty() ? 0 : *std::max_element(track.px.begin(), track.px.end());
        const auto bin = std::upper_bound(std::begin(kUpTo_px), std::end(kUpTo_px), worst);
        ++ends[track.begin / kRange][reason][bin - std::begin(kUpTo_px)];
    }
    std::printf(
        "\ntracks ended, by their first image: of them with errors under 0.5, 1, 2, 5 px, "
        "more\n%-9s",
        "images");
    for (const char* name : kNames) std::printf(" %-29s", name);
    for (int k = 0; k < static_cast<int>(ends.size()); ++k) {
        std::printf("\n%4d-%4d", k * kRange, std::min(images, (k + 1) * kRange) - 1);
        for (const auto& of_reason : ends[k]) {
            std::printf(" %5d:", std::accumulate(of_reason.begin(), of_reason.end(), 0));
            for (const int n : of_reason) std::printf(" %4d", n);
            std::printf(" ");
        }
    }
    std::printf("\n");
}

// By the time since a track's first sight, and with what the truth and another
// estimate disagree in exchanged.
void print_comparison(const Input& input, const Poses& estimate, const Run& run) {
    constexpr double kSeconds[] = {0, 0.25, 0.5, 1, 2, 1e9};
    std::printf("\n%-42s %8s", "share under 2 px with", "all");
    for (int k = 0; k < 5; ++k) std::printf("  >%4.2f s", kSeconds[k]);
    std::printf("\n");
    const auto row = [&](const char* name, const Poses& T_W_C, double sigma_m, auto... counts) {
        const auto errors = epipolar_errors(*input.rig.camera, T_W_C, run);
        const auto share = [&](double least, double most) {
            return 100 * good_share(
                             errors,
                             [&](const EpipolarError& e) {
                                 return e.seconds() >= least && e.seconds() < most &&
                                        (counts(e) && ...);
                             },
                             sigma_m);
        };
        std::printf("%-42s %7.2f%%", name, share(0, 1e9));
        for (int k = 0; k < 5; ++k) std::printf(" %7.2f%%", share(kSeconds[k], kSeconds[k + 1]));
        std::printf("\n");
    };
    row("truth, mounting fitted", input.T_W_C_fitted, 0);
    row("  its positions known to 3 x 1 mm", input.T_W_C_fitted, 1e-3);
    row("  to 3 x 2 mm", input.T_W_C_fitted, 2e-3);
    const std::vector<Jump> jumps = truth_jumps(input);
    row("  where it does not jump between", input.T_W_C_fitted, 0, [&](const EpipolarError& e) {
        return std::none_of(jumps.begin(), jumps.end(),
                            [&](const Jump& jump) { return e.first <= jump.t && jump.t < e.now; });
    });
    if (!estimate.empty()) {
        row("estimate", estimate, 0);
        row("truth's rotations, estimate's positions", mixed(input.T_W_C_fitted, estimate), 0);
        row("estimate's rotations, truth's positions", mixed(estimate, input.T_W_C_fitted), 0);
    }
    std::printf("the truth's position jumps %zu times by more than 1 mm:", jumps.size());
    for (const Jump& jump : jumps)
        std::printf(" %.1f mm at %.2f s", 1e3 * jump.metres,
                    vio::to_seconds(jump.t - input.truth.front().t));
    std::printf("\n");
}

struct Request {
    std::vector<std::string> files, assignments;
    std::string estimate;
    bool brief = false, ends = false, spoil = false;
};

int measure(const Request& request) {
    const std::vector<std::string>& files = request.files;
    cv::setNumThreads(1);
    vio::TrackerOptions options;
    vio::OptionSet declared;
    options.describe(declared);
    vio::ScenarioOptions scenario;
    if (files.size() > 2) scenario = vio::ScenarioOptions::from_file(files[2]);
    vio::OptionSet of_scenario;
    scenario.describe(of_scenario);
    for (const std::string& assignment : request.assignments)
        (assignment.rfind("tracker.", 0) == 0 ? declared : of_scenario).set(assignment);
    Input input = read_input(files[0], files[1]);
    std::optional<vio::Simulation> simulation;
    if (files.size() > 2) simulation.emplace(scenario);
    const vio::Simulation* truth = simulation ? &*simulation : nullptr;

    if (truth) {
        input.T_W_C_fitted = input.T_W_C;
    } else {
        vio::TrackerOptions few = options;
        few.max_features = 50;
        const Mounting mounting =
            fit_mounting(input, run_tracker(input, few, {.prediction = false, .feedback = false}));
        input.T_W_C_fitted = camera_poses(input, mounting);
        const Vector3d r = 1 / vio::kDegree * mounting.rotation;
        std::printf("the truth's mounting: %.3f %.3f %.3f deg, clock: %.2f ms\n", r.x(), r.y(),
                    r.z(), 1e3 * mounting.time_offset);
    }
    print_header(truth != nullptr);
    const auto row = [&](const std::string& name, const Parts& parts, auto... changes) {
        vio::TrackerOptions changed = options;
        (changes(changed), ...);
        const Run run = run_tracker(input, changed, parts);
        print_row(name, input, truth, run);
        return run;
    };
    const Run all = row("all parts", {});
    if (truth && request.ends) print_ends(input, *truth, all);
    if (!request.brief) {
        row("no feedback", {.feedback = false});
        row("no estimator's prediction", {.prediction = false});
        row("neither", {.prediction = false, .feedback = false});
        row("no gyro", {.gyro = false});
        row("no gyro, no prediction", {.gyro = false, .prediction = false});
        row("no first appearance", {}, [](auto& o) { o.realign = false; });
        row("looks not renewed", {}, [](auto& o) { o.renew_looks = false; });
        row("no two views", {}, [](auto& o) { o.two_views = false; });
        row("no window of 30 images", {}, [](auto& o) { o.window_images = 0; });
        const auto no_geometry = [](auto& o) { o.two_views = false, o.window_images = 0; };
        row("no geometry", {}, no_geometry);
        row("no geometry, no feedback", {.feedback = false}, no_geometry);
    }
    if (request.spoil)
        for (const auto& [name, spoiler] : spoilers()) {
            const Input changed = spoiled(input, spoiler);
            print_row(name, changed, truth, run_tracker(changed, options, {}));
            print_row("  without the estimator", changed, truth,
                      run_tracker(changed, options, {.prediction = false, .feedback = false}));
        }
    print_row("plain Lucas-Kanade", input, truth, run_plain_lk(input, options));
    Poses estimate;
    if (!request.estimate.empty()) estimate = read_input(files[0], request.estimate).T_W_C;
    if (!truth) print_comparison(input, estimate, all);
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    Request request;
    for (int i = 1; i < argc; ++i) {
        const std::string argument = argv[i];
        if (argument == "--set" && i + 1 < argc)
            request.assignments.push_back(argv[++i]);
        else if (argument == "--estimate" && i + 1 < argc)
            request.estimate = argv[++i];
        else if (argument == "--ends")
            request.ends = true;
        else if (argument == "--spoil")
            request.spoil = true;
        else if (argument == "--brief")
            request.brief = true;
        else
            request.files.push_back(argument);
    }
    if (request.files.size() < 2 || request.files.size() > 3) {
        std::fprintf(
            stderr,
            "usage: vio_track_quality RAWLOG TRUTH.tum [SCENARIO.ini] "
            "[--set SECTION.KEY=VALUE]... [--brief] [--ends] [--spoil] [--estimate POSES.tum]\n");
        return 2;
    }
    try {
        return measure(request);
    } catch (const std::exception& error) {
        std::fprintf(stderr, "vio_track_quality: %s\n", error.what());
        return 1;
    }
}
