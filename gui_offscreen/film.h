// Pictures one after another, as a video file.
#pragma once

#include <functional>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "gui_offscreen/scene.h"
#include "gui_offscreen/snapshot.h"

namespace vio {

/// A video file: H.264 in .mp4, motion JPEG in .avi. Throws InputError for another extension, and
/// where the file cannot be written. Complete once it is destroyed.
class VideoFile {
 public:
    /// Width and height even [px], rate [Hz].
    VideoFile(const std::string& file, int width, int height, double rate);
    ~VideoFile();
    VideoFile(const VideoFile&) = delete;
    VideoFile& operator=(const VideoFile&) = delete;

    /// 8-bit BGR of the size given at the start.
    void add(const cv::Mat& picture);

 private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// How a scene is filmed.
struct FilmOptions {
    SnapshotOptions picture;
    int frames = 300;
    double rate = 30;  ///< [Hz]
    /// Called with the share that is done.
    std::function<void(double)> progress;
};

/// One turn around the scene. Returns in one line why there is no film (off-screen OpenGL cannot
/// start), or nothing; throws as VideoFile does.
std::string film_turntable(const mrpt::opengl::COpenGLScene::Ptr& scene, const FilmOptions& options,
                           const std::string& file);

/// The path as it grows, in equal steps of time. The view stands still, but for View::kChase: then
/// it follows the robot, smoothly. Returns and throws as film_turntable().
std::string film_motion(const Estimate& estimate, const SceneOptions& scene,
                        const std::vector<NamedPath>& others, const FilmOptions& options,
                        const std::string& file);

}  // namespace vio
