#include <gtest/gtest.h>

#include <map>
#include <opencv2/imgproc.hpp>

#include "libvio/calibration/board_detector.h"
#include "libvio/camera/perspective.h"
#include "tests/board_images.h"
#include "tests/mirror_board.h"
#include "tests/unit/scratch_folder.h"
#include "tests/wanting.h"

namespace vio {
namespace {

PerspectiveCamera test_camera() {
    return PerspectiveCamera({640, 480, 420, 421, 322, 238, {-0.28, 0.07, 2e-4, -1e-4}});
}

struct Found {
    int visible = 0, found = 0, wrong = 0;
    double sum2 = 0;
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();

    double rms() const { return std::sqrt(sum2 / (2 * found)); }
};

// Corners against their true places. Visible: with ten pixels to the image's border.
Found compare(const std::vector<FeatureObservation>& seen, const Board& board, const Camera& camera,
              const Pose& T_G_C) {
    Found result;
    std::map<FeatureId, Eigen::Vector2d> truth;
    for (const auto& [id, point] : board.points)
        if (const auto uv = camera.project(T_G_C.inverse() * point.p_W)) {
            truth[id] = *uv;
            result.visible += camera.inside_image(*uv, 10);
        }
    for (const FeatureObservation& f : seen) {
        if (!truth.contains(f.feature_id) || (truth[f.feature_id] - f.uv_px).norm() > 1) {
            ++result.wrong;
            continue;
        }
        const Eigen::Vector2d error = f.uv_px - truth[f.feature_id];
        ++result.found;
        result.sum += error;
        result.sum2 += error.squaredNorm();
    }
    return result;
}

// Light that falls to a fifth from one side to the other, and a blurred image.
cv::Mat badly_lit(const cv::Mat& image) {
    cv::Mat bad = image.clone();
    for (int u = 0; u < bad.cols; ++u) bad.col(u) *= 1 - 0.8 * u / bad.cols;
    cv::GaussianBlur(bad, bad, {}, 1.2);
    return bad;
}

Found over_poses(const test::Pattern& pattern, const Board& board, const std::vector<Pose>& poses,
                 bool bad_light = false) {
    const auto camera = test_camera();
    const test::BoardRenderer renderer(camera, pattern, 3);
    const BoardDetector detector(board);
    Found all;
    for (std::size_t k = 0; k < poses.size(); ++k) {
        const cv::Mat image = renderer.image(poses[k], k + 1);
        const Found one =
            compare(detector.detect(bad_light ? badly_lit(image) : image), board, camera, poses[k]);
        all.visible += one.visible;
        all.found += one.found;
        all.wrong += one.wrong;
        all.sum += one.sum;
        all.sum2 += one.sum2;
    }
    return all;
}

TEST(BoardDetector, AprilGridCornersAreFoundToATenthOfAPixelAndRightlyNumbered) {
    VIO_SKIP_FOR(BoardDetector::knows_april_grids() ? "" : "built without AprilTag");
    const test::AprilGridPattern pattern;
    const Board board =
        make_april_grid(pattern.cols, pattern.rows, pattern.tag_size, pattern.spacing);
    const Found all =
        over_poses(pattern, board, test::poses_before(0.55, 0.44, true, 7, 0.4, 1, 3));
    EXPECT_EQ(all.wrong, 0);
    EXPECT_GT(all.found, 0.9 * all.visible);  // whole tags only
    EXPECT_LT(all.rms(), 0.1);
    EXPECT_LT(all.sum.norm() / all.found, 0.02);
}

// In a mirror the board is bent and shown the other way round; its place is known only nominally.
TEST(BoardDetector, AprilGridIsFoundInAMirror) {
    VIO_SKIP_FOR(BoardDetector::knows_april_grids() ? "" : "built without AprilTag");
    test::MirrorBoard mirror(1);
    const auto shot = mirror.shoot();
    EXPECT_TRUE(BoardDetector(mirror.board()).detect(shot.image).empty());
    const BoardDetector detector(mirror.board(), test::mirror_camera());
    const Found found =
        compare(detector.detect(shot.image), mirror.board(), mirror.camera(), shot.T_C_G.inverse());
    EXPECT_GE(found.found, 40);
    EXPECT_EQ(found.wrong, 0);
    EXPECT_LT(found.rms(), 0.1);
    EXPECT_LT(found.sum.norm() / found.found, 0.03);
}

TEST(BoardDetector, CheckerboardIsNumberedTheSameFromAllSides) {
    const test::CheckerboardPattern pattern;
    const Board board =
        make_checkerboard(pattern.cols, pattern.rows, pattern.spacing, pattern.spacing);
    std::vector<Pose> poses;
    for (int k = 0; k < 4; ++k) {  // turned about the optical axis by 90 degrees each
        const Eigen::Matrix3d R = so3::exp({0.2, -0.3, 0}) * so3::exp({0, 0, k * 1.571});
        poses.push_back({R, Eigen::Vector3d(0.21, 0.12, 0) - R * Eigen::Vector3d(0, 0, 0.6)});
    }
    for (const bool bad_light : {false, true}) {
        const Found all = over_poses(pattern, board, poses, bad_light);
        EXPECT_EQ(all.wrong, 0);
        EXPECT_GE(all.found, 4 * pattern.cols * pattern.rows);
        EXPECT_LT(all.rms(), bad_light ? 0.2 : 0.1);
        EXPECT_LT(all.sum.norm() / all.found, bad_light ? 0.06 : 0.02);
    }
}

TEST(BoardDetector, FindsNothingWhereNothingIs) {
    cv::Mat noise(480, 640, CV_8UC1);
    cv::RNG(1).fill(noise, cv::RNG::UNIFORM, 0, 255);
    EXPECT_TRUE(BoardDetector(make_checkerboard(8, 5, 0.1, 0.1)).detect(noise).empty());
    if (BoardDetector::knows_april_grids()) {
        EXPECT_TRUE(BoardDetector(make_april_grid(5, 4, 0.1, 0.3)).detect(noise).empty());
    }
    EXPECT_NE(test::error_of([] { BoardDetector{Board{}}; }).find("no pattern"), std::string::npos);
}

}  // namespace
}  // namespace vio
