// vio-slam render: pictures and videos of results, scenes and feature tracks.
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>

#include "app/commands.h"
#include "app/picture.h"
#include "app/progress.h"
#include "app/recording_text.h"
#include "app/track_pictures.h"
#include "gui_offscreen/film.h"
#include "gui_offscreen/scene.h"
#include "gui_offscreen/snapshot.h"
#include "libvio/base/angles.h"
#include "libvio/base/errors.h"
#include "libvio/base/files.h"
#include "libvio/io/results.h"
#include "libvio/io/trajectory_io.h"

namespace vio::app {
namespace {

namespace fs = std::filesystem;

struct Arguments {
    std::string source, output, view = "iso", size = "1280x720", film, truth;
    double turn_deg = 0, seconds = 10, rate = 30;
    bool dark = false;
    std::string colour = "uncertainty";
    TrackPictureRequest tracks;
};

SnapshotOptions picture_options(const Arguments& arguments) {
    SnapshotOptions options;
    char rest = 0;
    if (std::sscanf(arguments.size.c_str(), "%dx%d%c", &options.width, &options.height, &rest) !=
            2 ||
        options.width < 64 || options.height < 64 || options.width > 8192 ||
        options.height > 8192 || options.width % 4 != 0)
        throw InputError("--size " + arguments.size +
                         ": expected WxH in pixels, 64 to 8192, the width a multiple of 4");
    options.view = *parse_view(arguments.view);
    options.turn = arguments.turn_deg * kDegree;
    return options;
}

bool is_video(const std::string& file) {
    const std::string extension = fs::path(file).extension().string();
    return extension == ".mp4" || extension == ".avi";
}

// Returns why there is no picture, or nothing.
std::string render_scene(const mrpt::opengl::COpenGLScene::Ptr& scene, const Arguments& arguments,
                         const FilmOptions& film) {
    if (is_video(arguments.output)) return film_turntable(scene, film, arguments.output);
    const Snapshot snapshot = render_snapshot(scene, film.picture);
    if (snapshot.problem.empty()) save_image(snapshot.image, arguments.output);
    return snapshot.problem;
}

std::string render_results(const Arguments& arguments, const FilmOptions& film) {
    const Estimate estimate = read_results(arguments.source);
    NamedPath truth{arguments.truth, {}};
    if (!arguments.truth.empty()) truth.poses = read_trajectory(arguments.truth);
    Drawing drawing = drawing_of(estimate, read_results_rig(arguments.source), truth);
    if (!drawing.problem.empty()) throw InputError(drawing.problem);
    drawing.options.dark = arguments.dark;
    if (arguments.colour == "image") {
        if (natural_colour(estimate.landmarks) != LandmarkColour::kImage)
            throw InputError(arguments.source +
                             ": its landmarks have no image colours, since it was estimated from "
                             "feature tracks; leave out --colour");
        drawing.options.landmark_colour = LandmarkColour::kImage;
    }
    if (is_video(arguments.output) && arguments.film != "turntable")
        return film_motion(estimate, drawing.options, drawing.others, film, arguments.output);
    return render_scene(build_scene(estimate, drawing.options, drawing.others), arguments, film);
}

// What can be drawn, and as what.
enum Kind : unsigned { kResult = 1, kScene = 2, kTracks = 4, kPicture = 8, kVideo = 16 };

struct Applies {
    const char* option;
    unsigned to;  // kinds of source, and of output
};
constexpr unsigned kBoth = kPicture | kVideo;
constexpr Applies kApplies[] = {
    {"--view", kResult | kScene | kBoth},  {"--size", kResult | kScene | kBoth},
    {"--turn", kResult | kScene | kBoth},  {"--dark", kResult | kBoth},
    {"--colour", kResult | kBoth},         {"--truth", kResult | kBoth},
    {"--film", kResult | kVideo},          {"--seconds", kResult | kScene | kVideo},
    {"--rate", kResult | kScene | kVideo}, {"--images", kTracks | kPicture},
    {"--from", kTracks | kBoth},           {"--to", kTracks | kBoth},
    {"--calibration", kTracks | kBoth},    {"--camera-label", kTracks | kBoth},
    {"--imu-label", kTracks | kBoth},      {"--bit-depth", kTracks | kBoth},
};

Kind kind_of(const std::string& source) {
    if (is_folder(source)) return kResult;
    return fs::path(source).extension() == ".rawlog" ? kTracks : kScene;
}

// An option that would have no effect is a mistake about what is drawn.
void refuse_what_does_not_apply(const CLI::App& command, const Arguments& arguments) {
    const unsigned source = kind_of(arguments.source);
    const unsigned output = is_video(arguments.output) ? kVideo : kPicture;
    const auto name = [](unsigned kind) {
        return kind == kResult    ? "a results folder"
               : kind == kScene   ? "a .3Dscene"
               : kind == kTracks  ? "a rawlog's feature tracks"
               : kind == kPicture ? "a picture"
                                  : "a video";
    };
    for (const Applies& applies : kApplies)
        for (const unsigned kind : {source, output})
            if (command.count(applies.option) > 0 && !(applies.to & kind))
                throw InputError(arguments.source + ": " + applies.option + " does not apply to " +
                                 name(kind) + "; leave it out");
}

void run(const CLI::App& command, const Arguments& arguments) {
    refuse_what_does_not_apply(command, arguments);
    FilmOptions film;
    film.picture = picture_options(arguments);
    film.rate = arguments.rate;
    film.frames = std::max(1, static_cast<int>(std::lround(arguments.seconds * arguments.rate)));
    std::string problem;
    {
        Progress progress("rendering");
        film.progress = [&](double share) { progress.update(share); };
        const Kind kind = kind_of(arguments.source);
        if (kind == kResult) {
            problem = render_results(arguments, film);
        } else if (kind == kTracks) {
            TrackPictureRequest request = arguments.tracks;
            request.rawlog = arguments.source;
            request.output = arguments.output;
            request.video = is_video(arguments.output);
            write_track_pictures(request, film.progress);
        } else {
            problem = render_scene(load_scene(arguments.source), arguments, film);
        }
    }
    if (!problem.empty()) throw InputError(problem);
    std::cout << arguments.output << "\n";
}

}  // namespace

void add_render(CLI::App& program) {
    CLI::App* command = program.add_subcommand(
        "render", "Picture or video of a result, a scene or feature tracks, without a display");
    auto arguments = std::make_shared<Arguments>();
    command
        ->add_option("SOURCE", arguments->source,
                     "Results folder; .3Dscene file; or rawlog, whose images are drawn with their "
                     "feature tracks")
        ->required();
    command
        ->add_option("-o,--output", arguments->output,
                     "Picture (.png, .jpg) or video (.mp4, .avi) to write")
        ->required();
    command->add_option("--view", arguments->view, "Where to look from")
        ->check(CLI::IsMember({"iso", "top", "side", "chase"}))
        ->capture_default_str();
    command->add_option("--size", arguments->size, "Width x height [px]")->capture_default_str();
    command->add_option("--turn", arguments->turn_deg, "Turn the view about the vertical [deg]")
        ->capture_default_str();
    command->add_flag("--dark", arguments->dark, "Dark background");
    command
        ->add_option("--colour", arguments->colour,
                     "Of a result's landmarks: by uncertainty, or as in the images")
        ->check(CLI::IsMember({"uncertainty", "image"}))
        ->capture_default_str();
    command->add_option("--truth", arguments->truth,
                        "True trajectory (TUM or EuRoC) to draw beside a result");
    command
        ->add_option("--film", arguments->film,
                     "What a video shows of a result: its motion (default), or one turn around it")
        ->check(CLI::IsMember({"motion", "turntable"}));
    command->add_option("--seconds", arguments->seconds, "Length of a video of a scene [s]")
        ->check(CLI::Range(0.1, 3600.0))
        ->capture_default_str();
    command->add_option("--rate", arguments->rate, "Pictures per second of such a video [Hz]")
        ->check(CLI::Range(1.0, 120.0))
        ->capture_default_str();
    command
        ->add_option("--images", arguments->tracks.images,
                     "Images in a picture of feature tracks, evenly spread")
        ->check(CLI::Range(1, 100))
        ->capture_default_str();
    const std::string use = "For a rawlog's feature tracks: ";
    add_part_options(*command, arguments->tracks.part, use);
    add_recording_options(*command, arguments->tracks.recording, use);
    command->callback([command, arguments] { run(*command, *arguments); });
}

}  // namespace vio::app
