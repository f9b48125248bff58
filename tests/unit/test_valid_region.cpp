#include <gtest/gtest.h>

#include "libvio/tracking/valid_region.h"
#include "tests/mirror_camera.h"

namespace vio {
namespace {

TEST(ValidRegion, IsTheMirrorWithoutItsMiddleAndItsEdges) {
    const CameraPtr camera = test::mirror_camera();
    constexpr int kBorder = 5;
    const cv::Mat region = valid_region(*camera, kBorder);
    ASSERT_EQ(region.size(), cv::Size(640, 480));
    int seeing = 0;
    for (int v = 0; v < 480; v += 3)
        for (int u = 0; u < 640; u += 3) {
            const bool allowed = region.at<unsigned char>(v, u);
            seeing += allowed;
            bool all = true;
            for (const Eigen::Vector2d& step :
                 {Eigen::Vector2d(0, 0), Eigen::Vector2d(kBorder, 0), Eigen::Vector2d(-kBorder, 0),
                  Eigen::Vector2d(0, kBorder), Eigen::Vector2d(0, -kBorder)})
                all = all && camera->ray(Eigen::Vector2d(u, v) + step);
            EXPECT_TRUE(all || !allowed) << u << " " << v;
        }
    EXPECT_GT(seeing, 0.3 * (640 * 480) / 9.0);
    EXPECT_FALSE(region.at<unsigned char>(240, 320));
    EXPECT_FALSE(region.at<unsigned char>(5, 5));
}

TEST(ValidRegion, IsEmptyWhereAllPixelsSee) {
    CameraDescription d;
    d.lens = {64, 48, 50, 50, 32, 24, {}};
    EXPECT_TRUE(valid_region(*make_camera(d), 5).empty());
}

}  // namespace
}  // namespace vio
