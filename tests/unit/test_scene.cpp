// Scenes, pictures and overlays. Pictures are skipped where off-screen OpenGL cannot start.
#include <gtest/gtest.h>
#include <mrpt/opengl/CPointCloudColoured.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <random>

#include "gui_offscreen/framing.h"
#include "gui_offscreen/overlay.h"
#include "gui_offscreen/scene.h"
#include "gui_offscreen/snapshot.h"
#include "libvio/base/errors.h"
#include "tests/wanting.h"

namespace vio {
namespace {

/// A figure of eight inside a room; every hundredth landmark is a far outlier.
Estimate eight(int poses = 200, int landmarks = 500) {
    std::mt19937 engine(1);
    std::uniform_real_distribution<double> unit(-1, 1);
    Estimate estimate;
    estimate.g_W = {0, 0, -9.81};
    for (int i = 0; i < poses; ++i) {
        const double a = 2 * M_PI * i / poses;
        StateEstimate state;
        state.t = i * TimeNs{50'000'000};
        state.T_W_B = {look_along({std::cos(a), std::cos(2 * a), 0}),
                       {2 * std::sin(a), 1.5 * std::sin(2 * a), 0.3 * std::cos(a)}};
        state.covariance.setIdentity();
        state.covariance *= 1e-3;
        state.lost = i > poses / 2 && i < poses * 6 / 10;
        estimate.states.push_back(state);
    }
    for (int i = 0; i < landmarks; ++i) {
        LandmarkEstimate landmark;
        landmark.id = i;
        landmark.p_W = Eigen::Vector3d(3 * unit(engine), 2, 1.5 * unit(engine));
        if (i % 100 == 0) landmark.p_W *= 1000;
        landmark.covariance = (1e-4 + 1e-3 * std::abs(unit(engine))) * Eigen::Matrix3d::Identity();
        estimate.landmarks.push_back(landmark);
    }
    return estimate;
}

std::string temporary(const std::string& name) {
    return (std::filesystem::temp_directory_path() / (std::to_string(getpid()) + "_" + name))
        .string();
}

int count_near(const cv::Mat& image, const cv::Vec3b& bgr, int tolerance) {
    int count = 0;
    for (int y = 0; y < image.rows; ++y)
        for (int x = 0; x < image.cols; ++x)
            count += cv::norm(image.at<cv::Vec3b>(y, x), bgr, cv::NORM_INF) <= tolerance;
    return count;
}

TEST(Framing, HoldsEveryPointInsideThePictureAndTouchesItsMargin) {
    const Estimate estimate = eight();
    std::vector<Eigen::Vector3d> points;
    for (const StateEstimate& s : estimate.states) points.push_back(s.T_W_B.p);
    const int width = 640, height = 480;
    for (const Eigen::Vector3d& forward :
         {Eigen::Vector3d(0, 0, -1), Eigen::Vector3d(0, 1, 0), Eigen::Vector3d(-1, 1, -1)})
        for (double half_view : {0.03, 0.4, 0.8}) {
            const CameraPlacement camera =
                frame_points(points, look_along(forward), width, height, half_view, 0.05);
            double widest = 0;
            for (const Eigen::Vector3d& p_W : points) {
                const Eigen::Vector3d p = camera.T_W_C.inverse() * p_W;
                EXPECT_GT(p.z(), camera.near_m);
                EXPECT_LT(p.z(), camera.far_m);
                widest = std::max({widest, std::abs(camera.focal_px * p.x() / p.z()) / width,
                                   std::abs(camera.focal_px * p.y() / p.z()) / height});
            }
            EXPECT_NEAR(widest, 0.45, 1e-9) << forward.transpose() << ", " << half_view;
        }
}

TEST(Framing, SurroundingsNeverPushThePathOutOfThePicture) {
    const Estimate estimate = eight();
    std::vector<Eigen::Vector3d> path, wall;
    for (const StateEstimate& s : estimate.states) path.push_back(s.T_W_B.p);
    for (const LandmarkEstimate& l : estimate.landmarks) wall.push_back(l.p_W);  // outliers too
    for (const Eigen::Vector3d& forward : {Eigen::Vector3d(0, 0, -1), Eigen::Vector3d(-1, 1, -1)}) {
        const CameraPlacement camera = frame_path(path, wall, look_along(forward), 640, 480, 0.4);
        double widest = 0;
        for (const Eigen::Vector3d& p_W : path) {
            const Eigen::Vector3d p = camera.T_W_C.inverse() * p_W;
            EXPECT_GT(p.z(), camera.near_m);
            EXPECT_LT(p.z(), camera.far_m);
            EXPECT_LT(std::abs(camera.focal_px * p.x() / p.z()), 320);
            EXPECT_LT(std::abs(camera.focal_px * p.y() / p.z()), 240);
            widest = std::max({widest, std::abs(camera.focal_px * p.x() / p.z()) / 320,
                               std::abs(camera.focal_px * p.y() / p.z()) / 240});
        }
        EXPECT_GT(widest, 0.5) << "the path stays the subject";
    }
}

TEST(Framing, FarLandmarksDoNotCount) {
    const Estimate estimate = eight();
    std::vector<Eigen::Vector3d> path, landmarks;
    for (const StateEstimate& s : estimate.states) path.push_back(s.T_W_B.p);
    for (const LandmarkEstimate& l : estimate.landmarks) landmarks.push_back(l.p_W);
    const auto near = nearby_points(path, landmarks);
    EXPECT_GT(near.size(), 400u);
    for (const Eigen::Vector3d& p : near) EXPECT_LT(p.norm(), 6);
    EXPECT_TRUE(nearby_points({}, landmarks).empty());
}

TEST(Scene, SurvivesItsFile) {
    const std::string file = temporary("scene.3Dscene");
    const auto scene = build_scene(
        eight(), {}, {{"truth", {{0, Pose()}, {1, {Eigen::Matrix3d::Identity(), {1, 1, 1}}}}}});
    save_scene(*scene, file);
    const auto loaded = load_scene(file);
    std::vector<std::string> before, after;
    scene->dumpListOfObjects(before);
    loaded->dumpListOfObjects(after);
    EXPECT_EQ(before, after);
    for (const char* name : {"path estimate", "path lost", "path truth", "cameras", "gravity",
                             "newest camera", "world axes", "position, 3 sigma"}) {
        ASSERT_TRUE(loaded->getByName(name)) << name;
        const auto a = scene->getByName(name)->getBoundingBox(),
                   b = loaded->getByName(name)->getBoundingBox();
        // The file holds the newest camera's pose in single precision.
        EXPECT_LT((a.min - b.min).norm() + (a.max - b.max).norm(), 1e-6) << name;
        EXPECT_EQ(scene->getByName(name)->getColor_u8(), loaded->getByName(name)->getColor_u8());
    }
    std::filesystem::remove(file);
}

TEST(Scene, TakesEmptyAndDamagedEstimates) {
    EXPECT_TRUE(build_scene({}));
    Estimate estimate = eight(3, 3);
    estimate.states[1].T_W_B.p.x() = NAN;
    estimate.states[2].covariance.setConstant(NAN);
    estimate.landmarks[0].p_W.setConstant(INFINITY);
    estimate.landmarks[1].covariance.setZero();
    const auto scene = build_scene(estimate);
    const auto box = scene->getByName("path estimate")->getBoundingBox();
    EXPECT_LT(box.max.x, 10);
}

TEST(Scene, BadFilesAreOneLine) {
    EXPECT_THROW(load_scene("/nonexistent/x.3Dscene"), InputError);
    const std::string file = temporary("text.3Dscene");
    std::ofstream(file) << "not a scene";
    EXPECT_THROW(load_scene(file), InputError);
    std::filesystem::remove(file);
    EXPECT_THROW(save_scene(*build_scene(eight(3, 3)), "/nonexistent/x.3Dscene"), InputError);
    EXPECT_THROW(save_image(cv::Mat(4, 4, CV_8UC3), "/nonexistent/x.png"), InputError);
    EXPECT_FALSE(parse_view("front"));
}

TEST(Snapshot, ShowsThePathInItsColourFromEveryView) {
    SnapshotRenderer renderer(637, 401);  // neither a multiple of four
    VIO_SKIP_FOR(renderer.problem());
    Estimate whole = eight();
    for (StateEstimate& state : whole.states) state.lost = false;
    for (bool dark : {false, true}) {
        SceneOptions options;
        options.dark = dark;
        for (const char* word : {"top", "side", "iso", "chase"}) {
            SnapshotOptions snapshot;
            snapshot.view = parse_view(word).value();
            snapshot.legend = false;
            const auto picture = [&](const Estimate& estimate) {
                return renderer.render(build_scene(estimate, options), snapshot).image;
            };
            const auto count = [](const cv::Mat& image, const auto& is_it) {
                return std::count_if(image.begin<cv::Vec3b>(), image.end<cv::Vec3b>(), is_it);
            };
            const auto is_blue = [](const cv::Vec3b& c) { return c[0] > c[2] + 90 && c[0] > 140; };
            const auto is_red = [](const cv::Vec3b& c) {
                return c[2] > c[0] + 90 && c[2] > c[1] + 60;
            };
            const cv::Mat image = picture(eight());
            ASSERT_EQ(image.size(), cv::Size(637, 401));
            EXPECT_GT(count_near(image, image.at<cv::Vec3b>(0, 0), 8), 50'000) << "background";
            EXPECT_GT(count(image, is_blue), 500) << word;
            // The x axis is red as well.
            EXPECT_GT(count(image, is_red), count(picture(whole), is_red) + 10)
                << word << ": the lost stretch";
        }
    }
}

TEST(Snapshot, IsTheSameAfterTheSceneWasSavedAndFromASecondRenderer) {
    const auto scene = build_scene(eight());
    const std::string file = temporary("again.3Dscene");
    save_scene(*scene, file);
    SnapshotOptions options;
    options.width = 320;
    options.height = 240;
    const Snapshot first = render_snapshot(scene, options);
    VIO_SKIP_FOR(first.problem);
    const Snapshot second = render_snapshot(scene, options);
    const Snapshot third = render_snapshot(load_scene(file), options);
    EXPECT_EQ(cv::norm(first.image, second.image, cv::NORM_INF), 0);
    // The file holds the newest camera in single precision, so an edge may move by a hair.
    EXPECT_LT(cv::norm(first.image, third.image, cv::NORM_L1) / double(first.image.total()), 0.01);
    std::filesystem::remove(file);

    const std::string picture = temporary("picture.png");
    save_image(first.image, picture);
    EXPECT_EQ(cv::norm(first.image, cv::imread(picture), cv::NORM_INF), 0);
    std::filesystem::remove(picture);
}

TEST(Snapshot, RefusesSizesThatNoPictureHas) {
    EXPECT_THROW(SnapshotRenderer(0, 100), InputError);
    EXPECT_THROW(SnapshotRenderer(100000, 100), InputError);
}

TEST(Scene, LandmarksTakeTheColoursOfTheImagesWhenAsked) {
    Estimate estimate = eight(20, 3);
    estimate.landmarks[1].rgb = {{200, 100, 50}};
    SceneOptions options;
    options.landmark_colour = LandmarkColour::kImage;
    const auto scene = build_scene(estimate, options);
    const auto cloud = std::dynamic_pointer_cast<mrpt::opengl::CPointCloudColoured>(
        scene->getByName("landmarks, colours of the images"));
    ASSERT_TRUE(cloud);
    ASSERT_EQ(cloud->size(), 3u);
    const auto color = cloud->getPointColor(1);
    EXPECT_EQ(color.R, 200);
    EXPECT_EQ(color.G, 100);
    EXPECT_EQ(color.B, 50);
}

TEST(Overlay, MarksTracksThatEndedByWhatBecameOfThem) {
    const cv::Mat image(120, 160, CV_8UC1, cv::Scalar(100));
    std::vector<FeatureFrame> frames(9);
    frames[0].features = {{.feature_id = 4, .uv_px = {130.0, 30.0}}};
    for (size_t i = 0; i < 5; ++i)
        frames[i + 1].features = {{.feature_id = 1, .uv_px = {30.0, 30.0}},
                                  {.feature_id = 2, .uv_px = {80.0, 30.0}}};
    const cv::Mat picture = draw_tracks(image, frames, {1});
    const auto near = [&](int x, const cv::Vec3b& bgr) {
        return count_near(picture(cv::Rect(x - 6, 24, 12, 12)), bgr, 40);
    };
    const cv::Vec3b red(70, 60, 240), grey(170, 170, 170);
    EXPECT_GT(near(30, red), 8) << "rejected";
    EXPECT_GT(near(80, grey), 8) << "gone";
    EXPECT_EQ(near(80, red), 0);
    EXPECT_EQ(near(130, red) + near(130, grey), 0) << "gone too long ago to be shown";

    cv::Mat with_key = picture.clone();
    draw_track_key(with_key);
    EXPECT_GT(cv::norm(with_key, picture, cv::NORM_L1), 0);
    EXPECT_EQ(cv::norm(with_key.rowRange(0, 80), picture.rowRange(0, 80), cv::NORM_L1), 0);
}

TEST(Overlay, DrawsFeaturesWhereTheyAreWithTheirTails) {
    const cv::Mat image(120, 160, CV_8UC1, cv::Scalar(100));
    std::vector<FeatureFrame> frames(10);
    for (int i = 0; i < 10; ++i) {
        frames[static_cast<size_t>(i)].features.push_back(
            {.feature_id = 7, .uv_px = {20.0 + 8 * i, 60.0}});
        frames[static_cast<size_t>(i)].features.push_back(
            {.feature_id = i + 100, .uv_px = {80.0, 20.0}});
    }
    const cv::Mat picture = draw_tracks(image, frames);
    ASSERT_EQ(picture.type(), CV_8UC3);
    const auto is_grey = [&](int x, int y) {
        const auto& c = picture.at<cv::Vec3b>(y, x);
        return c[0] == c[1] && c[1] == c[2];
    };
    EXPECT_FALSE(is_grey(92, 60)) << "the feature";
    EXPECT_FALSE(is_grey(40, 60)) << "its tail";
    EXPECT_FALSE(is_grey(80, 20)) << "a new feature";
    EXPECT_TRUE(is_grey(40, 80));
    EXPECT_TRUE(is_grey(120, 60));
    EXPECT_EQ(draw_tracks(image, {}).size(), image.size());
}

}  // namespace
}  // namespace vio
