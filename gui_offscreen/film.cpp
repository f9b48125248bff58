#include "gui_offscreen/film.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/videoio.hpp>

#include "libvio/base/errors.h"

namespace vio {
namespace {

using Eigen::Vector3d;

int codec_of(const std::string& file) {
    const std::string extension = std::filesystem::path(file).extension().string();
    if (extension == ".mp4") return cv::VideoWriter::fourcc('a', 'v', 'c', '1');
    if (extension == ".avi") return cv::VideoWriter::fourcc('M', 'J', 'P', 'G');
    throw InputError(file + ": the name of a video must end in .mp4 or .avi");
}

// Where a robot was at a time, and which way its camera looked, averaged over the time around it: a
// hand-held or flying camera would shake the view. Gaussian weights, cut off at 3 sigma.
ChasePoint smoothed(const Estimate& estimate, const Pose& T_B_C, TimeNs t, double sigma_s) {
    const auto state_from = [&](TimeNs from) {
        return std::lower_bound(
            estimate.states.begin(), estimate.states.end(), from,
            [](const StateEstimate& state, TimeNs time) { return state.t < time; });
    };
    const auto first = state_from(t - from_seconds(3 * sigma_s));
    auto last = state_from(t + from_seconds(3 * sigma_s));
    if (first == last) last = first + 1;  // in a gap: the pose after it
    ChasePoint sum{Vector3d::Zero(), Vector3d::Zero()};
    double weights = 0;
    for (auto state = first; state != last; ++state) {
        const double u = to_seconds(state->t - t) / sigma_s;
        const double weight = std::exp(-0.5 * std::min(u * u, 100.0));
        const Pose T_W_C = state->T_W_B * T_B_C;
        sum.position += weight * T_W_C.p;
        sum.forward += weight * chase_direction(T_W_C);
        weights += weight;
    }
    sum.position /= weights;
    return sum;
}

}  // namespace

struct VideoFile::Impl {
    cv::VideoWriter writer;
    cv::Size size;
};

VideoFile::VideoFile(const std::string& file, int width, int height, double rate)
    : impl_(new Impl) {
    const int codec = codec_of(file);
    if (width % 2 || height % 2) throw InputError("a video's width and height must be even");
    impl_->size = {width, height};
    if (!impl_->writer.open(file, codec, rate, impl_->size))
        throw InputError(file +
                         ": the video cannot be written; check the folder and the free space, or "
                         "try the name with .avi");
}

VideoFile::~VideoFile() = default;

void VideoFile::add(const cv::Mat& picture) {
    if (picture.size() != impl_->size || picture.type() != CV_8UC3)
        throw InputError("a video's pictures must be colour and all of one size");
    impl_->writer.write(picture);
}

std::string film_turntable(const mrpt::opengl::COpenGLScene::Ptr& scene, const FilmOptions& options,
                           const std::string& file) {
    SnapshotOptions picture = options.picture;
    SnapshotRenderer renderer(picture.width, picture.height, picture.supersampling);
    if (!renderer.problem().empty()) return renderer.problem();
    VideoFile video(file, picture.width, picture.height, options.rate);
    for (int i = 0; i < options.frames; ++i) {
        picture.turn = options.picture.turn + 2 * M_PI * i / options.frames;
        video.add(renderer.render(scene, picture).image);
        if (options.progress) options.progress((i + 1.0) / options.frames);
    }
    return "";
}

std::string film_motion(const Estimate& estimate, const SceneOptions& scene_options,
                        const std::vector<NamedPath>& others, const FilmOptions& options,
                        const std::string& file) {
    if (estimate.states.empty()) throw InputError("a film needs an estimate with poses");
    SnapshotOptions picture = options.picture;
    SnapshotRenderer renderer(picture.width, picture.height, picture.supersampling);
    if (!renderer.problem().empty()) return renderer.problem();
    VideoFile video(file, picture.width, picture.height, options.rate);
    const TimeNs begin = estimate.states.front().t;
    const double length = to_seconds(estimate.states.back().t - begin);
    // The view moves no faster than about a third of a second of film, however fast time passes.
    const double sigma_s =
        std::max(0.35 * options.rate * length / std::max(options.frames, 1), 1e-3);
    const double extent = path_extent(estimate, others);
    SceneOptions until = scene_options;
    for (int i = 0; i < options.frames; ++i) {
        until.until = begin + from_seconds(length * (i + 1) / options.frames);
        if (picture.view == View::kChase) {
            picture.chase = smoothed(estimate, scene_options.T_B_C, *until.until, sigma_s);
            picture.chase->extent = extent;
        }
        video.add(renderer.render(build_scene(estimate, until, others), picture).image);
        if (options.progress) options.progress((i + 1.0) / options.frames);
    }
    return "";
}

}  // namespace vio
