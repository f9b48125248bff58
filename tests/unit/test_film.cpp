// Videos: written, read back, and what they show. Skipped where off-screen OpenGL cannot start.
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/videoio.hpp>

#include "gui_offscreen/film.h"
#include "libvio/base/errors.h"
#include "tests/unit/scratch_folder.h"
#include "tests/wanting.h"

namespace vio {
namespace {

Estimate circle() {
    Estimate estimate;
    estimate.g_W = {0, 0, -9.81};
    for (int i = 0; i < 60; ++i) {
        const double a = 2 * M_PI * i / 60;
        StateEstimate state;
        state.t = i * TimeNs{100'000'000};
        state.T_W_B = {so3::exp({0, 0, a}), {2 * std::sin(a), 2 - 2 * std::cos(a), 0}};
        estimate.states.push_back(state);
    }
    return estimate;
}

std::vector<cv::Mat> frames_of(const std::string& file) {
    cv::VideoCapture video(file);
    std::vector<cv::Mat> frames;
    for (cv::Mat frame; video.read(frame);) frames.push_back(frame.clone());
    return frames;
}

int blue_pixels(const cv::Mat& image) {
    int count = 0;
    for (auto c = image.begin<cv::Vec3b>(); c != image.end<cv::Vec3b>(); ++c)
        count += (*c)[0] > (*c)[2] + 90 && (*c)[0] > 140;
    return count;
}

FilmOptions small_film(View view) {
    FilmOptions options;
    options.picture.width = 320;
    options.picture.height = 240;
    options.picture.supersampling = 1;
    options.picture.legend = false;
    options.picture.view = view;
    options.frames = 12;
    options.rate = 3;
    return options;
}

TEST(Film, TurntableEndsWhereItBeganAndShowsAllSides) {
    const test::ScratchFolder folder;
    const std::string file = folder / "turn.avi";
    const std::string problem = film_turntable(build_scene(circle()), small_film(View::kIso), file);
    VIO_SKIP_FOR(problem);
    const auto frames = frames_of(file);
    ASSERT_EQ(frames.size(), 12u);
    EXPECT_EQ(frames[0].size(), cv::Size(320, 240));
    const auto difference = [&](size_t a, size_t b) {
        return cv::norm(frames[a], frames[b], cv::NORM_L1) / double(frames[a].total());
    };
    EXPECT_GT(difference(0, 6), 1) << "another side of the scene";
    EXPECT_LT(difference(0, 11), 2 * difference(0, 1)) << "one step before the beginning";
}

TEST(Film, MotionGrowsThePathUnderAViewThatStandsStill) {
    const test::ScratchFolder folder;
    const std::string file = folder / "motion.mp4";
    const std::string problem = film_motion(circle(), {}, {}, small_film(View::kTop), file);
    VIO_SKIP_FOR(problem);
    const auto frames = frames_of(file);
    ASSERT_EQ(frames.size(), 12u);
    EXPECT_GT(blue_pixels(frames[11]), 1.7 * blue_pixels(frames[3]));
}

TEST(Film, ChaseKeepsTheRobotInView) {
    const test::ScratchFolder folder;
    const std::string file = folder / "chase.avi";
    const std::string problem = film_motion(circle(), {}, {}, small_film(View::kChase), file);
    VIO_SKIP_FOR(problem);
    for (const cv::Mat& frame : frames_of(file))
        EXPECT_GT(blue_pixels(frame(cv::Rect(80, 60, 160, 120))), 50) << "the robot's frustum";
}

TEST(Film, RefusesWhatNoVideoCanBe) {
    EXPECT_THROW(VideoFile("x.gif", 64, 48, 30), InputError);
    EXPECT_THROW(VideoFile("x.avi", 63, 48, 30), InputError);
    EXPECT_THROW(VideoFile("/nonexistent/x.avi", 64, 48, 30), InputError);
    EXPECT_THROW(film_motion({}, {}, {}, small_film(View::kIso), "x.avi"), InputError);
}

}  // namespace
}  // namespace vio
